#include "preprocess/grid/grid_views.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "preprocess/grid/box_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kBoxes = 4;
constexpr double kGoldenRatio = 0.6180339887498949;

struct SampledBox {
  uint32_t block = 0;  // of the grid
  NodeBox rows;

  bool overlaps(const SampledBox& other) const {
    return block == other.block && rows.j0 < other.rows.j1 && other.rows.j0 < rows.j1 &&
           rows.k0 < other.rows.k1 && other.rows.k0 < rows.k1;
  }
};

/// The first and the end of `rows` of `count` rows, around row `middle`.
std::pair<uint64_t, uint64_t> around(uint64_t middle, uint64_t rows, uint64_t count) {
  rows = std::min(rows, count);
  const uint64_t before = std::min(middle, rows / 2);
  const uint64_t first = std::min(middle - before, count - rows);
  return {first, first + rows};
}

/// A box of about `nodes` nodes around plane `k` and the given part of its rows; of two rows and planes at
/// least, so that it has cells.
SampledBox boxAround(const GridBlock& block, uint64_t k, double part, uint64_t nodes) {
  const double rows = static_cast<double>(nodes) / static_cast<double>(block.ni);
  const auto planes = static_cast<uint64_t>(std::max(2.0, std::sqrt(rows)));
  SampledBox box;
  std::tie(box.rows.k0, box.rows.k1) = around(k, planes, block.nk);
  const auto along_j = static_cast<uint64_t>(rows / static_cast<double>(box.rows.k1 - box.rows.k0));
  const auto j = static_cast<uint64_t>(part * static_cast<double>(block.nj));
  std::tie(box.rows.j0, box.rows.j1) = around(j, std::max<uint64_t>(2, along_j), block.nj);
  return box;
}

std::vector<SampledBox> boxesOf(const std::vector<GridBlock>& blocks, uint64_t nodes) {
  uint64_t all = 0;
  for (const GridBlock& block : blocks) all += block.nodes();
  std::vector<SampledBox> boxes;
  if (all <= nodes) {
    for (uint32_t block = 0; block < blocks.size(); ++block)
      boxes.push_back({block, {0, blocks[block].nj, 0, blocks[block].nk}});
    return boxes;
  }
  // Small blocks are taken whole: then there are more boxes than kBoxes.
  uint64_t taken = 0;
  for (uint64_t n = 0; taken < nodes && n < nodes; ++n) {
    const double place =
        std::fmod((static_cast<double>(n) + 0.5) * (n < kBoxes ? 1.0 / kBoxes : kGoldenRatio), 1.0);
    auto before = static_cast<uint64_t>(place * static_cast<double>(all));
    uint32_t block = 0;
    while (before >= blocks[block].nodes()) before -= blocks[block++].nodes();
    const uint64_t k = before / (blocks[block].ni * blocks[block].nj);
    SampledBox box = boxAround(blocks[block], k, std::fmod(static_cast<double>(n) * kGoldenRatio + 0.5, 1.0),
                               nodes / kBoxes);
    box.block = block;
    if (std::any_of(boxes.begin(), boxes.end(), [&](const SampledBox& other) { return box.overlaps(other); }))
      continue;
    taken += (box.rows.j1 - box.rows.j0) * (box.rows.k1 - box.rows.k0) * blocks[block].ni;
    boxes.push_back(box);
  }
  return boxes;
}

class SampleSource final : public ForwardingGrid {
 public:
  SampleSource(std::shared_ptr<const GridSource> source, uint64_t nodes)
      : ForwardingGrid(std::move(source)), boxes_(boxesOf(description_.blocks, nodes)) {
    description_.boundaries.clear();
    description_.flow.clear();
    description_.blocks.clear();
    for (const SampledBox& box : boxes_) {
      GridBlock block = this->source().description().blocks[box.block];
      block.nj = box.rows.j1 - box.rows.j0;
      block.nk = box.rows.k1 - box.rows.k0;
      description_.blocks.push_back(std::move(block));
    }
  }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    ForwardingGrid::read(boxes_[block].block, inGrid(block, box), scalars, out);
    for (size_t n = 0; n < scalars.size(); ++n)
      if (description_.scalars[scalars[n]].centring == Centring::kCell) cutCells(block, box, out.scalars[n]);
  }

  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    return ForwardingGrid::readFringe(boxes_[block].block, inGrid(block, box), out);
  }

 private:
  NodeBox inGrid(uint32_t block, const NodeBox& box) const {
    const NodeBox& rows = boxes_[block].rows;
    return {rows.j0 + box.j0, rows.j0 + box.j1, rows.k0 + box.k0, rows.k0 + box.k1, box.i0, box.i1};
  }

  /// No cell begins at the last row or plane of a block.
  void cutCells(uint32_t block, const NodeBox& box, std::vector<float>& values) const {
    const GridBlock& of = description_.blocks[block];
    const auto row_nodes = static_cast<std::ptrdiff_t>(box.rowNodes(of.ni));
    auto row = values.begin();
    for (uint64_t k = box.k0; k < box.k1; ++k)
      for (uint64_t j = box.j0; j < box.j1; ++j, row += row_nodes)
        if (j + 1 == of.nj || k + 1 == of.nk)
          std::fill_n(row, row_nodes, std::numeric_limits<float>::quiet_NaN());
  }

  const std::vector<SampledBox> boxes_;
};

}  // namespace

std::unique_ptr<GridSource> sampleOf(std::shared_ptr<const GridSource> source, uint64_t nodes) {
  return std::make_unique<SampleSource>(std::move(source), nodes);
}

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

namespace {

class ReorderedSource final : public ForwardingGrid {
 public:
  ReorderedSource(const GridSource& source, std::vector<uint32_t> order)
      : ForwardingGrid(source), order_(std::move(order)) {
    const std::vector<GridBlock>& blocks = source.description().blocks;
    CURVISPLAT_CHECK_OP(order_.size(), ==, blocks.size());
    std::vector<uint32_t> places(order_.size());
    for (uint32_t n = 0; n < order_.size(); ++n) {
      description_.blocks[n] = blocks.at(order_[n]);
      places[order_[n]] = n;
    }
    for (GridBoundary& boundary : description_.boundaries) boundary.block = places.at(boundary.block);
    for (FlowConditions& flow : description_.flow) flow.block = places.at(flow.block);
  }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    ForwardingGrid::read(order_.at(block), box, scalars, out);
  }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    return ForwardingGrid::readFringe(order_.at(block), box, out);
  }

 private:
  std::vector<uint32_t> order_;
};

}  // namespace

std::vector<uint32_t> orderByName(const std::vector<GridBlock>& blocks,
                                  const std::vector<std::string>& names) {
  if (blocks.size() != names.size()) return {};
  std::map<std::string, uint32_t> numbers;
  for (uint32_t n = 0; n < blocks.size(); ++n) numbers.emplace(blocks[n].name, n);
  if (numbers.size() != blocks.size()) return {};
  std::vector<uint32_t> order;
  bool same = true;
  for (uint32_t n = 0; n < names.size(); ++n) {
    const auto found = numbers.find(names[n]);
    if (found == numbers.end()) return {};
    order.push_back(found->second);
    same &= found->second == n;
    numbers.erase(found);
  }
  return same ? std::vector<uint32_t>{} : order;
}

std::unique_ptr<GridSource> reordered(const GridSource& source, std::vector<uint32_t> order) {
  return std::make_unique<ReorderedSource>(source, std::move(order));
}

}  // namespace curvisplat
