// BlockSource, the base of readers of structured formats. A reader says where the numbers of a block are in
// its files; BlockSource reads boxes and parts of rows, blanking and fringes, and puts the values of cells at
// their lowest nodes.
//
//   class MySource final : public BlockSource {
//     BlockArray<Places> nodesOf(uint32_t block) const override {
//       return [=](uint64_t first, uint64_t count, const Places& to) { ... to.span(0, count) ... };
//     }
//     BlockArray<float*> valuesOf(uint32_t block, uint32_t scalar) const override { ... }
//   };
//
// Any number of threads read at once. Errors name the file.
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
  std::array<uint64_t, 2> memory{};  // values from one row to the next, and rows from one plane to the next
  std::array<uint64_t, 2> whole{};   // values of a row, and rows of a plane, of the whole array

  bool empty() const { return count[0] == 0 || count[1] == 0 || count[2] == 0; }
};

/// The part of a box of a block that has samples, nodes or cells, as a box of an array of all of them. A cell
/// has the place of its lowest node.
ArrayBox partWithSamples(const GridBlock& block, const NodeBox& box, Centring centring);

/// The destination of positions.
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
  /// The block has no such values.
  BlockArray() = default;
  /// `run` reads the values [first, first + count) to `to`. `along`: the values of a row and the rows of a
  /// plane in the file, if these are more than the block has.
  template <std::invocable<uint64_t, uint64_t, const To&> Run>
  BlockArray(Run run, std::array<uint64_t, 2> along = {}) : run_(std::move(run)), along_(along) {}
  /// `box` reads a box, for files that read boxes faster than rows. Leaves other elements as they are.
  template <std::invocable<const ArrayBox&, const To&> Box>
  BlockArray(Box box) : box_(std::move(box)) {}

  explicit operator bool() const { return run_ || box_; }
  /// Runs are as long as the file allows: a plane of whole rows, or a part of a row.
  void read(const ArrayBox& box, const To& to) const;

 private:
  std::function<void(uint64_t first, uint64_t count, const To& to)> run_;
  std::array<uint64_t, 2> along_{};
  std::function<void(const ArrayBox& box, const To& to)> box_;
};

extern template class BlockArray<Places>;
extern template class BlockArray<float*>;

/// Nodes whose x depends on i alone, y on j and z on k: place(axis, index).
BlockArray<Places> placesAlongAxes(std::function<double(size_t axis, uint64_t index)> place);

/// Reads the magnitudes of vectors: read(component, values) reads one of their components.
template <typename Read>
void readMagnitude(size_t components, std::span<float> to, const Read& read) {
  std::vector<double> squares(to.size(), 0.0);
  for (size_t c = 0; c < components; ++c) {
    read(c, to);
    for (size_t n = 0; n < to.size(); ++n) squares[n] += double{to[n]} * to[n];
  }
  for (size_t n = 0; n < to.size(); ++n) to[n] = static_cast<float>(std::sqrt(squares[n]));
}

/// The magnitude of a vector. Needs buffers of 65,536 values, or of a row.
BlockArray<float*> magnitudeOf(std::vector<BlockArray<float*>> components);

class BlockSource : public BoxSource {
 public:
  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const final;
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const final;

 protected:
  virtual BlockArray<Places> nodesOf(uint32_t block) const = 0;
  /// Values that a block does not have are NaN.
  virtual BlockArray<float*> valuesOf(uint32_t block, uint32_t scalar) const = 0;
  /// A node is blanked where this is 0. Only blocks that have blanking are asked.
  virtual BlockArray<float*> iblankOf(uint32_t /*block*/) const { return {}; }
  /// Blanks nodes of a box by other means.
  virtual void blankNodes(uint32_t /*block*/, const NodeBox& /*box*/, std::vector<uint8_t>& /*blank*/) const {
  }
  /// Makes values NaN in cells of a box.
  virtual void blankCells(uint32_t /*block*/, const NodeBox& /*box*/, std::vector<float>& /*values*/) const {}

  GridDescription description_;      // with all blocks and scalars
  bool negative_is_fringe_ = false;  // of iblank

 private:
  template <typename Use>
  void forEachIblank(uint32_t block, const NodeBox& box, const Use& use) const;
};

}  // namespace curvisplat
