#include "preprocess/grid/thinned_source.h"

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

namespace curvisplat {
namespace {

/// The number of planes that are left of `count`.
uint64_t thinnedCount(uint64_t count, uint64_t stride) {
  return count < 2 ? count : (count - 2) / stride + 2;
}

/// The plane of the grid that is plane `n` of the thinned one.
uint64_t planeOf(uint64_t n, uint64_t count, uint64_t stride) {
  return std::min(n * stride, count - 1);
}

uint64_t thinnedNodes(const GridDescription& grid, uint64_t stride) {
  uint64_t nodes = 0;
  for (const GridBlock& block : grid.blocks)
    nodes += thinnedCount(block.ni, stride) * thinnedCount(block.nj, stride) * thinnedCount(block.nk, stride);
  return nodes;
}

class ThinnedSource final : public GridSource {
 public:
  ThinnedSource(const GridSource& source, uint64_t stride)
      : source_(source), stride_(stride), description_(source.description()) {
    description_.boundaries.clear();
    description_.flow.clear();
    for (GridBlock& block : description_.blocks) {
      block.ni = thinnedCount(block.ni, stride);
      block.nj = thinnedCount(block.nj, stride);
      block.nk = thinnedCount(block.nk, stride);
    }
  }

  const GridDescription& description() const override { return description_; }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    for (auto* values : {&out.x, &out.y, &out.z}) values->clear();
    out.blank.clear();
    out.scalars.resize(scalars.size());
    for (std::vector<float>& values : out.scalars) values.clear();
    NodeArrays row;
    forEachRow(block, box, [&](const NodeBox& rows) {
      source_.read(block, rows, scalars, row);
      append(block, row.x, out.x);
      append(block, row.y, out.y);
      append(block, row.z, out.z);
      append(block, row.blank, out.blank);
      for (size_t n = 0; n < scalars.size(); ++n) append(block, row.scalars[n], out.scalars[n]);
    });
    for (size_t n = 0; n < scalars.size(); ++n)
      if (description_.scalars[scalars[n]].centring == Centring::kCell) cutCells(block, box, out.scalars[n]);
  }

  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    out.clear();
    bool tells = true;
    std::vector<uint8_t> row;
    forEachRow(block, box, [&](const NodeBox& rows) {
      tells = tells && source_.readFringe(block, rows, row);
      if (tells) append(block, row, out);
    });
    return tells;
  }

 private:
  /// Calls `take` with each row of the box, as a box of the grid.
  template <typename Take>
  void forEachRow(uint32_t block, const NodeBox& box, const Take& take) const {
    const GridBlock& whole = source_.description().blocks[block];
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j) {
        const uint64_t row = planeOf(j, whole.nj, stride_), plane = planeOf(k, whole.nk, stride_);
        take(NodeBox{row, row + 1, plane, plane + 1});
      }
  }

  template <typename T>
  void append(uint32_t block, const std::vector<T>& row, std::vector<T>& out) const {
    const uint64_t count = source_.description().blocks[block].ni;
    for (uint64_t i = 0; i < description_.blocks[block].ni; ++i)
      out.push_back(row[planeOf(i, count, stride_)]);
  }

  /// No cell begins at the last plane of a direction.
  void cutCells(uint32_t block, const NodeBox& box, std::vector<float>& values) const {
    const GridBlock& of = description_.blocks[block];
    size_t n = 0;
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j)
        for (uint64_t i = 0; i < of.ni; ++i, ++n)
          if (i + 1 == of.ni || j + 1 == of.nj || k + 1 == of.nk)
            values[n] = std::numeric_limits<float>::quiet_NaN();
  }

  const GridSource& source_;
  const uint64_t stride_;
  GridDescription description_;
};

}  // namespace

uint64_t strideFor(const GridDescription& grid, uint64_t nodes) {
  uint64_t largest = 1;
  for (const GridBlock& block : grid.blocks) largest = std::max({largest, block.ni, block.nj, block.nk});
  uint64_t stride = 1;
  while (stride < largest && thinnedNodes(grid, stride) > nodes) ++stride;
  return stride;
}

std::unique_ptr<GridSource> thinned(const GridSource& source, uint64_t stride) {
  return std::make_unique<ThinnedSource>(source, stride);
}

}  // namespace curvisplat
