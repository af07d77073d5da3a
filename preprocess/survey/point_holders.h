// Which blocks hold which of the sample points, as the blocks' cells come one after another.
//
// A point that lies in kMaxHolders blocks is located no further: otherwise a set that names one file a thousand times would
// take the square of that. Where cells pass through one another, such as those of random coordinates, each of them meets a
// share of all points, nearly all of which are the block's own or were found in its first cells: those are sorted out on the
// way, and come back for the next block.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/grid/slabs.h"
#include "preprocess/survey/bounding_tree.h"
#include "preprocess/survey/overlap_points.h"
#include "preprocess/survey/point_tree.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// Some points, given by number, sorted into the cells of a uniform lattice. Any thread may ask.
class PointBins {
 public:
  PointBins(std::span<const BlockPoint> points, const std::vector<uint32_t>& numbers);

  /// Calls each(number) for the points of the bins that the box touches. False, and calls nothing, if there are many bins or points.
  template <typename Each>
  bool forEachOfFew(const BoundingBox& box, const Each& each) const;

 private:
  static constexpr uint64_t kAlongAxis = 64;
  std::array<uint64_t, 3> place(const glm::dvec3& position) const;
  uint64_t binOf(const glm::dvec3& position) const;

  BoundingBox box_;
  glm::dvec3 scale_{0.0};
  std::vector<uint32_t> first_, sorted_;
};

/// Its functions are called by one thread, and are parallel loops.
class PointHolders {
 public:
  /// Borrows the points, of one block after another.
  explicit PointHolders(std::span<const BlockPoint> points);

  bool areAllFound() const { return !is_pruned_ && tree_.size() == 0; }
  /// Whether points of another block lie in the box of this one.
  bool mayHold(uint32_t block, const BoundingBox& box) const;
  /// Locates the points in the cells of a slab with kCornerHalo. Throws Interrupted if a stop is asked for.
  void locate(const GridBlock& block, const LoadedSlab& loaded, const Progress& progress);
  /// To be called after the last slab of each block: the points that lie in it and not in kMaxHolders blocks before it, rising. Valid
  /// until the next call.
  std::span<const uint32_t> finishBlock();
  /// How often cells met points that were not to be located in them, in the blocks that are finished.
  uint64_t metInVain() const { return met_in_vain_; }

  static constexpr uint8_t kMaxHolders = 16;
  /// For each point, beside the point.
  static constexpr uint64_t kBytesEach = 160;

 private:
  void locateInCell(uint32_t block, const std::array<glm::dvec3, 8>& corner, std::vector<uint32_t>& found);
  bool isWanted(uint32_t point, uint32_t block) const;
  bool shouldPrune() const;
  void prune(uint32_t block);
  void sort(const std::vector<uint32_t>& wanted);

  const std::span<const BlockPoint> points_;
  std::vector<uint8_t> counts_;  // [point]
  std::vector<std::atomic<uint32_t>>
      latest_;                      // [point]: 1 + the latest block that is known to contain it; 0: none
  PointBins bins_;                  // the points still to be located, and few others
  PointTree tree_;                  // the same: for cells in whose bins many lie
  size_t finished_ = 0;             // of the points in tree_
  bool is_pruned_ = false;          // tree_ lacks points that blocks to come are searched for
  std::atomic<size_t> in_vain_{0};  // how often cells met points that are not wanted, since tree_ was built
  uint64_t met_in_vain_ = 0;        // before that
  std::vector<uint32_t> inside_, given_;  // of the block; those that finishBlock() has returned
};

template <typename Each>
bool PointBins::forEachOfFew(const BoundingBox& box, const Each& each) const {
  constexpr uint64_t kFewBins = 64, kFewPoints = 64;
  if (!box_.touches(box)) return true;
  const auto low = place(box.lower), high = place(box.upper);
  if ((high[0] - low[0] + 1) * (high[1] - low[1] + 1) * (high[2] - low[2] + 1) > kFewBins) return false;
  const auto for_each_row = [&](const auto& visit) {
    for (uint64_t z = low[2]; z <= high[2]; ++z)
      for (uint64_t y = low[1]; y <= high[1]; ++y) {
        const uint64_t row = (z * kAlongAxis + y) * kAlongAxis;
        visit(first_[row + low[0]], first_[row + high[0] + 1]);
      }
  };
  uint64_t count = 0;
  for_each_row([&](uint32_t begin, uint32_t end) { count += end - begin; });
  if (count > kFewPoints) return false;
  if (count == 0) return true;
  for_each_row([&](uint32_t begin, uint32_t end) {
    for (uint32_t n = begin; n < end; ++n) each(sorted_[n]);
  });
  return true;
}

}  // namespace curvisplat
