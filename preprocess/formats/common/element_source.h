// ElementSource, the base of readers of unstructured formats, which say how points, cells and values of a
// piece are read. (Structured formats: block_source.h.)
//
// Any number of threads read at once. Errors name the file.
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
  /// Appends cells [first, first + count), without values, to `out`, which is empty.
  virtual void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const = 0;
  /// Reads values of a scalar, at points or in cells, from number `first` on. `to` is NaN before, and stays so
  /// where the piece has none.
  virtual void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const = 0;

  GridDescription description_;  // with all pieces and scalars
  bool has_curved_cells_ = false;

 private:
  void readAll(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
               std::vector<std::vector<float>>& out) const;
};

/// The point that a file counts from `first` under this number. What is no number of a point becomes one that is too large, which
/// checkCells() refuses.
inline uint64_t pointNumber(double number, double first = 0) {
  const double point = number - first;
  return point >= 0 && point <= 0x1p53 ? static_cast<uint64_t>(point) : std::numeric_limits<uint64_t>::max();
}

/// Elements of a list, which is one of several that follow one another in a piece.
struct PartOfList {
  size_t list = 0;                // its number
  uint64_t first = 0, count = 0;  // in the list
  uint64_t at = 0;                // of the first, among the elements that are asked for
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
