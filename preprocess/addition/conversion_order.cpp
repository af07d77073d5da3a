#include "preprocess/addition/conversion_order.h"

#include <algorithm>

#include "stream/base/check.h"
#include "stream/base/error.h"

namespace curvisplat {

NodeNumbers::NodeNumbers(const std::vector<BlockInfo>& blocks) : blocks_(blocks) {
  uint64_t node = 0;
  for (const BlockInfo& block : blocks) {
    first_nodes_.push_back(node);
    node += block.ni * block.nj * block.nk;
  }
}

uint64_t NodeNumbers::firstOf(const NodeRun& run) const {
  const bool inside = run.block < blocks_.size() && run.count <= blocks_[run.block].ni &&
                      run.i <= blocks_[run.block].ni - run.count && run.j < blocks_[run.block].nj &&
                      run.k < blocks_[run.block].nk;
  if (!inside)
    throw Error("{} nodes from block {}, {} {} {} are not in the grid; the cache is damaged: convert again",
                run.count, run.block + uint64_t{1}, run.i, run.j, run.k);
  const BlockInfo& block = blocks_[run.block];
  return first_nodes_[run.block] + (run.k * block.nj + run.j) * block.ni + run.i;
}

std::string NodeNumbers::nameOf(uint64_t node) const {
  const auto after = std::upper_bound(first_nodes_.begin(), first_nodes_.end(), node);
  const auto number = static_cast<size_t>(after - first_nodes_.begin() - 1);
  const BlockInfo& block = blocks_[number];
  const uint64_t in_block = node - first_nodes_[number];
  return fmt::format("node {} {} {} of block {}", in_block % block.ni, in_block / block.ni % block.nj,
                     in_block / block.ni / block.nj, number + 1);
}

ConversionOrder::ConversionOrder(const CacheReader& cache)
    : bricks_(cache.bricks()), positions_(bricks_.size()) {
  order_.reserve(bricks_.size());
  for (uint32_t root = 0; root < bricks_.size() && bricks_[root].cell.level == 0; ++root) append(root);
  CURVISPLAT_CHECK_OP(order_.size(), ==, bricks_.size());

  const NodeNumbers numbers(cache.manifest().blocks);
  SplatGeometry geometry;
  std::vector<NodeRun> runs;
  for (uint32_t brick = 0; brick < bricks_.size(); ++brick) {
    if (!sharesItsCell(brick)) continue;
    cache.readGeometry(brick, geometry, &runs);
    if (runs.empty()) throw Error("{}: brick {} is a leaf without nodes", cache.path().string(), brick);
    first_nodes_[brick] = numbers.firstOf(runs.front());
  }
}

void ConversionOrder::append(uint32_t brick) {
  const Brick& of = bricks_[brick];
  for (uint32_t n = 0; n < of.child_count; ++n) append(of.first_child + n);
  positions_[brick] = static_cast<uint32_t>(order_.size());
  order_.push_back(brick);
}

bool ConversionOrder::sharesItsCell(uint32_t brick) const {
  const Cell& cell = bricks_[brick].cell;
  return (brick > 0 && bricks_[brick - 1].cell == cell) ||
         (brick + 1 < bricks_.size() && bricks_[brick + 1].cell == cell);
}

uint32_t ConversionOrder::leafOf(const RootPosition& position, uint64_t node) const {
  uint32_t brick = 0;
  while (!bricks_[brick].isLeaf()) {
    const Brick& above = bricks_[brick];
    const Cell cell = above.cell.child(octantOf(position, above.cell));
    uint32_t child = above.first_child;
    const uint32_t end = above.first_child + above.child_count;
    while (child < end && !(bricks_[child].cell == cell)) ++child;
    if (child == end) return kNoBrick;
    brick = child;
  }
  // The last of the cell's bricks that does not begin after the node.
  while (brick + 1 < bricks_.size() && bricks_[brick + 1].cell == bricks_[brick].cell &&
         first_nodes_.at(brick + 1) <= node)
    ++brick;
  return brick;
}

}  // namespace curvisplat
