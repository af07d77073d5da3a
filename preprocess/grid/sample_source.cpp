#include "preprocess/grid/sample_source.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

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

/// A box of about `nodes` nodes around plane `k` and the given part of its rows; of two rows and planes at least, so that
/// it has cells.
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

class SampleSource final : public GridSource {
 public:
  SampleSource(std::shared_ptr<const GridSource> source, uint64_t nodes)
      : source_(std::move(source)),
        boxes_(boxesOf(source_->description().blocks, nodes)),
        description_(source_->description()) {
    description_.boundaries.clear();
    description_.flow.clear();
    description_.blocks.clear();
    for (const SampledBox& box : boxes_) {
      GridBlock block = source_->description().blocks[box.block];
      block.nj = box.rows.j1 - box.rows.j0;
      block.nk = box.rows.k1 - box.rows.k0;
      description_.blocks.push_back(std::move(block));
    }
  }

  const GridDescription& description() const override { return description_; }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    readBox(*source_, boxes_[block].block, inGrid(block, box), scalars, out);
    for (size_t n = 0; n < scalars.size(); ++n)
      if (description_.scalars[scalars[n]].centring == Centring::kCell) cutCells(block, box, out.scalars[n]);
  }

  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override {
    return source_->rowsInMemory(scalars);
  }

  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    return source_->readFringe(boxes_[block].block, inGrid(block, box), out);
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

  const std::shared_ptr<const GridSource> source_;
  const std::vector<SampledBox> boxes_;
  GridDescription description_;
};

}  // namespace

std::unique_ptr<GridSource> sampleOf(std::shared_ptr<const GridSource> source, uint64_t nodes) {
  return std::make_unique<SampleSource>(std::move(source), nodes);
}

}  // namespace curvisplat
