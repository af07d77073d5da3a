#include "stream/vdb/counting_grid.h"

#include <openvdb/openvdb.h>

#include <algorithm>
#include <limits>

#include "stream/base/error.h"
#include "tools/vdb/vdb_plugin.h"

namespace curvisplat {
namespace {

using CountTree = openvdb::Int32Tree;
using Leaf = CountTree::LeafNodeType;
using Lower = CountTree::RootNodeType::ChildNodeType::ChildNodeType;
using Upper = CountTree::RootNodeType::ChildNodeType;

constexpr int32_t kFull = std::numeric_limits<int32_t>::max();
// The bytes of an allocated leaf: the node, its buffer and the allocator's share.
constexpr uint64_t kLeafBytes = sizeof(Leaf) + Leaf::SIZE * sizeof(int32_t) + 64;
constexpr uint64_t kSmallestTreeBytes = sizeof(Upper) + sizeof(Lower) + kLeafBytes;

openvdb::Coord voxelAt(const std::array<uint32_t, 3>& at) {
  return {static_cast<int32_t>(at[0]), static_cast<int32_t>(at[1]), static_cast<int32_t>(at[2])};
}

/// A tree that knows its size while it grows: asking OpenVDB for it walks all nodes.
struct SizedTree {
  CountTree tree{0};
  openvdb::tree::ValueAccessor<CountTree> accessor{tree};
  uint64_t bytes = 0;

  SizedTree() = default;
  SizedTree(const SizedTree&) = delete;
  SizedTree& operator=(const SizedTree&) = delete;
  ~SizedTree() { deleteNodes(tree); }

  void add(const openvdb::Coord& at, uint64_t count) {
    Leaf* leaf = accessor.probeLeaf(at);
    if (leaf == nullptr) {
      if (accessor.probeNode<Lower>(at) == nullptr) bytes += sizeof(Lower);
      if (accessor.probeNode<Upper>(at) == nullptr) bytes += sizeof(Upper);
      bytes += kLeafBytes;
      leaf = accessor.touchLeaf(at);
    }
    const openvdb::Index offset = Leaf::coordToOffset(at);
    const uint64_t sum = static_cast<uint64_t>(leaf->getValue(offset)) + count;
    leaf->setValueOn(offset, static_cast<int32_t>(std::min<uint64_t>(sum, kFull)));
  }
};

std::unique_ptr<SizedTree> halved(const CountTree& fine) {
  auto coarse = std::make_unique<SizedTree>();
  for (auto leaf = fine.cbeginLeaf(); leaf; ++leaf)
    for (auto value = leaf->cbeginValueOn(); value; ++value)
      coarse->add(value.getCoord() >> 1, static_cast<uint64_t>(*value));
  return coarse;
}

class VdbCountingGrid final : public CountingGrid {
 public:
  VdbCountingGrid(uint32_t level, uint64_t memory_bytes) : level_(level), memory_bytes_(memory_bytes) {
    CURVISPLAT_CHECK_OP(level, <=, static_cast<uint32_t>(kMaxLevel));
    levels_.push_back(std::make_unique<SizedTree>());
  }

  uint32_t level() const override { return level_; }
  void add(uint32_t level, std::span<const VoxelRun> runs) override;
  std::vector<VoxelRun> takeRuns() override;
  void addCoarser(uint32_t level, std::span<const VoxelRun> runs) override;
  void close() override;
  uint64_t count(const Cell& cell) const override;

 private:
  void coarsen();

  uint32_t level_;
  const uint64_t memory_bytes_;
  std::vector<std::unique_ptr<SizedTree>>
      levels_;  // [0] is of level_, each next one level coarser; only [0] until close()
};

void VdbCountingGrid::add(uint32_t level, std::span<const VoxelRun> runs) {
  CURVISPLAT_CHECK_OP(levels_.size(), ==, 1u);
  CURVISPLAT_CHECK_OP(level, >=, level_);
  for (const VoxelRun& run : runs) {
    const auto shift = static_cast<int>(level - level_);
    levels_[0]->add(voxelAt(run.voxel) >> shift, run.count);
    // When closed, the coarser levels stand beside the finest: together as large as it at most, but for the
    // least that a tree takes.
    while (2 * levels_[0]->bytes + level_ * kSmallestTreeBytes > memory_bytes_ && level_ > 0) coarsen();
  }
}

std::vector<VoxelRun> VdbCountingGrid::takeRuns() {
  CURVISPLAT_CHECK_OP(levels_.size(), ==, 1u);
  std::vector<VoxelRun> runs;
  const CountTree& tree = levels_[0]->tree;
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf)
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      const openvdb::Coord at = value.getCoord();
      runs.push_back(
          {{static_cast<uint32_t>(at.x()), static_cast<uint32_t>(at.y()), static_cast<uint32_t>(at.z())},
           static_cast<uint32_t>(*value)});
    }
  levels_[0] = std::make_unique<SizedTree>();
  return runs;
}

void VdbCountingGrid::addCoarser(uint32_t level, std::span<const VoxelRun> runs) {
  while (level_ > level) coarsen();
  add(level, runs);
}

void VdbCountingGrid::coarsen() {
  levels_[0] = halved(levels_[0]->tree);
  --level_;
}

void VdbCountingGrid::close() {
  while (levels_.size() <= level_) levels_.push_back(halved(levels_.back()->tree));
}

uint64_t VdbCountingGrid::count(const Cell& cell) const {
  CURVISPLAT_CHECK_OP(cell.level, <=, level_);
  CURVISPLAT_CHECK_OP(levels_.size(), ==, level_ + 1);
  const SizedTree& tree = *levels_[level_ - cell.level];
  return static_cast<uint64_t>(tree.tree.getValue(voxelAt(cell.at)));
}

}  // namespace

std::unique_ptr<CountingGrid> vdb_plugin::makeCountingGrid(uint32_t level, uint64_t memory_bytes) {
  return std::make_unique<VdbCountingGrid>(level, memory_bytes);
}

}  // namespace curvisplat
