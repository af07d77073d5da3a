// Counts positions by octree cell, in a sparse OpenVDB grid: voxel = cell of one level, value = count. It
// begins fine and merges 8 voxels to 1 whenever it outgrows its memory, so that it is as fine as the memory
// allows where the data are, whatever their clustering.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stream/model/octree.h"

namespace curvisplat {

/// `count` positions that followed one another in one voxel.
struct VoxelRun {
  std::array<uint32_t, 3> voxel;
  uint32_t count;
};

/// Counts of splats by cell. One thread at a time.
class CountingGrid {
 public:
  virtual ~CountingGrid() = default;

  /// The level that runs passed to add() are of.
  virtual uint32_t level() const = 0;
  /// Runs of voxels of `level`, which is level() or was.
  virtual void add(uint32_t level, std::span<const VoxelRun> runs) = 0;

  /// The counts, as runs of level(); none are left.
  virtual std::vector<VoxelRun> takeRuns() = 0;
  /// Runs of voxels of another grid, which may be coarser than this one: then this one becomes as coarse.
  virtual void addCoarser(uint32_t level, std::span<const VoxelRun> runs) = 0;

  /// Makes count() possible; nothing is added afterwards.
  virtual void close() = 0;
  /// Positions in `cell`, whose level is at most level(). A voxel counts up to 2^31 - 1.
  virtual uint64_t count(const Cell& cell) const = 0;
};

/// Voxels are cells of `level`, until memory makes them coarser. `memory_bytes` counts OpenVDB's nodes, with those of
/// the coarser levels that close() makes.
std::unique_ptr<CountingGrid> makeCountingGrid(uint32_t level, uint64_t memory_bytes);

/// Gathers positions into runs: the part of counting that threads do each for themselves.
class VoxelRuns {
 public:
  explicit VoxelRuns(uint32_t level) : level_(level) {}
  void add(const RootPosition& position) {
    const Cell cell = Cell::of(position, level_);
    if (runs_.empty() || !isSame(runs_.back().voxel, cell.at) || runs_.back().count == UINT32_MAX)
      runs_.push_back({cell.at, 0});
    ++runs_.back().count;
  }
  /// Makes each position stand for `factor` positions.
  void multiply(uint32_t factor) {
    for (VoxelRun& run : runs_)
      run.count = static_cast<uint32_t>(std::min<uint64_t>(uint64_t{run.count} * factor, UINT32_MAX));
  }
  uint32_t level() const { return level_; }
  std::span<const VoxelRun> runs() const { return runs_; }

 private:
  /// Compares without memcmp(), which == would call.
  static bool isSame(const std::array<uint32_t, 3>& a, const std::array<uint32_t, 3>& b) {
    return ((a[0] ^ b[0]) | (a[1] ^ b[1]) | (a[2] ^ b[2])) == 0;
  }

  uint32_t level_;
  std::vector<VoxelRun> runs_;
};

}  // namespace curvisplat
