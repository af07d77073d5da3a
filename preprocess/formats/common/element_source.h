// ElementSource, the base of readers of unstructured formats. A reader fills description_ in its constructor
// and says how the points, cells and values of a piece are read. (Structured formats: block_source.h.)
//
// Any number of threads may read at once, so the functions that a reader overrides must allow it. They throw
// Error with the name of the file.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "preprocess/formats/common/block_source.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

class ElementSource : public MeshSource {
 public:
  const GridDescription& description() const override { return description_; }
  bool hasCurvedCells() const override { return has_curved_cells_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const final;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const final;

 protected:
  /// Reads the positions of points [first, first + count).
  virtual void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const = 0;
  /// Appends cells [first, first + count), without values, to `out`, which is empty. Their corners are
  /// numbers of points in the piece, from 0.
  virtual void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const = 0;
  /// Reads the values of a scalar at the points, or in the cells, [first, first + to.size()) of a piece. `to`
  /// is filled with NaN before; leave it so where the piece has no values.
  virtual void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const = 0;

  GridDescription description_;  // with all pieces and scalars
  bool has_curved_cells_ = false;

 private:
  void readAll(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
               std::vector<std::vector<float>>& out) const;
};

/// The index, from 0, of the point with this number in a file that counts points from `first`. What cannot be
/// an index (negative, NaN, above 2^53) becomes the largest uint64_t, which checkCells() refuses.
inline uint64_t pointNumber(double number, double first = 0) {
  const double point = number - first;
  return point >= 0 && point <= 0x1p53 ? static_cast<uint64_t>(point) : std::numeric_limits<uint64_t>::max();
}

/// A range of the elements of one list, where a piece has several lists one after another.
struct PartOfList {
  size_t list = 0;                // index of the list
  uint64_t first = 0, count = 0;  // in the list
  uint64_t at = 0;                // index of the first element, from the first one that is asked for
};

/// Calls use(PartOfList) for each of `lists` that has some of the elements [first, first + count) of a piece.
/// countOf(list): how many elements the list has.
template <typename Lists, typename CountOf, typename Use>
void forEachPartOfLists(const Lists& lists, uint64_t first, uint64_t count, const CountOf& countOf,
                        const Use& use) {
  uint64_t begin = 0;
  for (size_t n = 0; n < lists.size(); ++n) {
    const uint64_t end = begin + countOf(lists[n]);
    const uint64_t from = std::max(first, begin), to = std::min(first + count, end);
    if (from < to) use(PartOfList{n, from - begin, to - from, from - first});
    begin = end;
  }
}

}  // namespace curvisplat
