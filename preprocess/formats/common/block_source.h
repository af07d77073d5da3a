// BlockSource, the base of readers of structured formats. A reader fills description_ in its constructor and
// says how to read the arrays of a block. BlockSource reads boxes and parts of rows from these arrays, blanks
// nodes by iblank, finds fringe nodes (GridSource::readFringe()) and puts the value of a cell at its lowest
// node.
//
//   class MySource final : public BlockSource {
//     BlockArray<Places> nodesOf(uint32_t block) const override {
//       return [=](uint64_t first, uint64_t count, const Places& to) { ... to.span(0, count) ... };
//     }
//     BlockArray<float*> valuesOf(uint32_t block, uint32_t scalar) const override { ... }
//   };
//
// Any number of threads may call read() and readFringe() at once, so the functions that a reader overrides,
// and what they return, must allow it too. They throw Error with the name of the file.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/grid/box_source.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A box of an array of values along i, j and k, and the layout of its destination.
struct ArrayBox {
  std::array<uint64_t, 3> first{}, count{};
  std::array<uint64_t, 2> memory{};  // in the destination: values from row to row, rows from plane to plane
  std::array<uint64_t, 2> whole{};   // of the whole array: values of a row, rows of a plane

  bool empty() const { return count[0] == 0 || count[1] == 0 || count[2] == 0; }
};

/// The part of `box` in which the block has samples, as a box of the array of all its nodes (ni x nj x nk) or
/// of all its cells (one fewer along each axis). A cell has the indices of its lowest node.
ArrayBox partWithSamples(const GridBlock& block, const NodeBox& box, Centring centring);

/// The destination of positions: an array of doubles for each axis, in world units.
struct Places {
  std::array<double*, 3> axes{};  // x, y, z

  std::span<double> span(size_t axis, uint64_t count) const { return {axes[axis], count}; }
  Places operator+(uint64_t n) const { return {{axes[0] + n, axes[1] + n, axes[2] + n}}; }
};

/// How to read an array of a block: the positions of its nodes (To is Places), or a scalar in its nodes or
/// cells (float*). Values are in the order of the file, i fastest, then j, then k.
template <typename To>
class BlockArray {
 public:
  /// An empty array: the block has no such values.
  BlockArray() = default;
  /// An array that is read by runs: run(first, count, to) writes the values [first, first + count) to `to`.
  /// `first` counts the values of the whole array in the order of the file. `along`: how many values a row
  /// has in the file, and how many rows a plane, if that is more than in the block; {0, 0}: as in the block.
  template <std::invocable<uint64_t, uint64_t, const To&> Run>
  BlockArray(Run run, std::array<uint64_t, 2> along = {}) : run_(std::move(run)), along_(along) {}
  /// An array that is read by boxes, for files where that is faster than rows: box(box, to) writes the box to
  /// `to` in the layout of ArrayBox::memory, and leaves what lies between its rows as it is.
  template <std::invocable<const ArrayBox&, const To&> Box>
  BlockArray(Box box) : box_(std::move(box)) {}

  explicit operator bool() const { return run_ || box_; }
  /// Reads a box. Its runs are as long as the file allows: whole rows of a plane, or a part of one row.
  void read(const ArrayBox& box, const To& to) const;

 private:
  std::function<void(uint64_t first, uint64_t count, const To& to)> run_;
  std::array<uint64_t, 2> along_{};
  std::function<void(const ArrayBox& box, const To& to)> box_;
};

extern template class BlockArray<Places>;
extern template class BlockArray<float*>;

/// Makes nodes whose x depends on i alone, y on j and z on k. place(axis, index): the coordinate, in world
/// units; any thread calls it.
BlockArray<Places> placesAlongAxes(std::function<double(size_t axis, uint64_t index)> place);

/// Overwrites `to` with the magnitudes of vectors. read(component, values) overwrites `values`, a span as
/// long as `to`, with one of their components.
template <typename Read>
void readMagnitude(size_t components, std::span<float> to, const Read& read) {
  std::vector<double> squares(to.size(), 0.0);
  for (size_t c = 0; c < components; ++c) {
    read(c, to);
    for (size_t n = 0; n < to.size(); ++n) squares[n] += double{to[n]} * to[n];
  }
  for (size_t n = 0; n < to.size(); ++n) to[n] = static_cast<float>(std::sqrt(squares[n]));
}

/// The magnitude of the vector with these components. Each read allocates buffers of at most 65,536 values,
/// or of one row if that is longer.
BlockArray<float*> magnitudeOf(std::vector<BlockArray<float*>> components);

class BlockSource : public BoxSource {
 public:
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const final;
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const final;

 protected:
  /// The positions of all nodes of a block. Called by each read().
  virtual BlockArray<Places> nodesOf(uint32_t block) const = 0;
  /// The values of description_.scalars[scalar] in a block, at its nodes or in its cells. Returns an empty
  /// array if the block has none: they are NaN then.
  virtual BlockArray<float*> valuesOf(uint32_t block, uint32_t scalar) const = 0;
  /// The iblank of a block's nodes: a node is blanked where it is 0. Called only for blocks with
  /// GridBlock::has_blanking.
  virtual BlockArray<float*> iblankOf(uint32_t /*block*/) const { return {}; }
  /// Blanks nodes that the file marks in another way than by iblank: sets blank[node of the box] to 1.
  virtual void blankNodes(uint32_t /*block*/, const NodeBox& /*box*/, std::vector<uint8_t>& /*blank*/) const {
  }
  /// Makes the values of blanked cells NaN. `values` has one for each node of the box, a cell's at its
  /// lowest.
  virtual void blankCells(uint32_t /*block*/, const NodeBox& /*box*/, std::vector<float>& /*values*/) const {}

  GridDescription description_;      // with all blocks and scalars
  bool negative_is_fringe_ = false;  // a negative iblank marks a fringe node (readFringe())

 private:
  template <typename Use>
  void forEachIblank(uint32_t block, const NodeBox& box, const Use& use) const;
};

}  // namespace curvisplat
