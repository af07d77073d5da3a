#include "preprocess/convert/counting_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/vec3.hpp>
#include <map>
#include <random>

#include "preprocess/convert/scan.h"

namespace curvisplat {
namespace {

RootPosition randomPosition(std::mt19937_64& random, int bits) {
  RootPosition position;
  for (auto& at : position.at) at = random() >> (64 - bits);
  return position;
}

TEST(CountingGrid, CountsWhatWasAddedAtEveryLevel) {
  std::mt19937_64 random(1);
  CountingGrid counts(6, 64 << 20);
  VoxelRuns runs(counts.level());
  std::vector<RootPosition> positions;
  for (int n = 0; n < 20000; ++n) positions.push_back(randomPosition(random, n % 2 ? 48 : 44));
  for (const RootPosition& position : positions) runs.add(position);
  counts.add(runs.level(), runs.runs());
  counts.close();
  ASSERT_EQ(counts.level(), 6u);
  for (uint32_t level = 0; level <= 6; ++level) {
    std::map<std::array<uint32_t, 3>, uint64_t> expected;
    for (const RootPosition& position : positions) ++expected[Cell::of(position, level).at];
    for (const auto& [at, count] : expected) EXPECT_EQ(counts.count({level, at}), count);
  }
  EXPECT_EQ(counts.count({6, {63, 0, 63}}) + counts.count({6, {0, 63, 0}}) > 20000, false);
}

TEST(CountingGrid, CoarsensWithinItsMemoryAndLosesNothing) {
  std::mt19937_64 random(2);
  CountingGrid counts(14, 16 << 20);
  for (int batch = 0; batch < 20; ++batch) {
    VoxelRuns runs(counts.level());
    for (int n = 0; n < 5000; ++n) runs.add(randomPosition(random, 48));
    counts.add(runs.level(), runs.runs());
  }
  counts.close();
  EXPECT_LT(counts.level(), 14u);
  EXPECT_GT(counts.level(), 2u);
  EXPECT_EQ(counts.count({0, {0, 0, 0}}), 100000u);
  uint64_t sum = 0;
  for (int octant = 0; octant < 8; ++octant) sum += counts.count(Cell{}.child(octant));
  EXPECT_EQ(sum, 100000u);
}

TEST(CountingGrid, TakesRunsThatWereGatheredBeforeItCoarsened) {
  std::mt19937_64 random(3);
  CountingGrid counts(14, 16 << 20);
  VoxelRuns early(14);
  const RootPosition position = randomPosition(random, 48);
  early.add(position);
  VoxelRuns many(14);
  for (int n = 0; n < 50000; ++n) many.add(randomPosition(random, 48));
  counts.add(14, many.runs());
  ASSERT_LT(counts.level(), 14u);
  const uint32_t level = counts.level();
  CountingGrid only_early(level, 16 << 20);
  only_early.add(14, early.runs());
  only_early.close();
  EXPECT_EQ(only_early.count(Cell::of(position, level)), 1u);
}

TEST(CountingGrid, ClustersStayFineWhereTheyFit) {
  CountingGrid counts(20, 32 << 20);
  VoxelRuns runs(20);
  std::mt19937_64 random(4);
  for (int n = 0; n < 100000; ++n) runs.add(randomPosition(random, 30));
  counts.add(20, runs.runs());
  counts.close();
  EXPECT_EQ(counts.level(), 20u);
  EXPECT_EQ(counts.count({18, {0, 0, 0}}), 100000u);
}

TEST(CountingLevel, IsThatOfVoxelsWithANodeEach) {
  const auto voxelsInBox = [](const glm::dvec3& extent, uint32_t level) {
    const double along = std::ldexp(1.0, static_cast<int>(level));
    return extent.x * along * extent.y * along * extent.z * along;
  };
  for (const glm::dvec3& extent : {glm::dvec3(1, 1, 1), glm::dvec3(1, 1, 0.01), glm::dvec3(0.03, 1, 0.02)}) {
    for (const uint64_t nodes : {1000u, 1000000u, 512000000u}) {
      const double voxels = voxelsInBox(extent, countingLevel(nodes, extent));
      EXPECT_GE(voxels, 8.0 * static_cast<double>(nodes));  // so that clusters show
      EXPECT_LE(voxels, 64.1 * static_cast<double>(nodes));
    }
  }
  // In any unit; and of grids without an extent along some axes.
  EXPECT_EQ(countingLevel(1000000, {3e-6, 3e-6, 3e-6}), countingLevel(1000000, {1, 1, 1}));
  EXPECT_GT(countingLevel(1000000, {1, 1, 0}), countingLevel(1000000, {1, 1, 1}));
  EXPECT_EQ(countingLevel(1000000, {0, 0, 0}), countingLevel(1000000, {1, 1, 1}));
  EXPECT_LE(countingLevel(uint64_t{1} << 47, {1, 0, 0}), static_cast<uint32_t>(kMaxLevel));
}

TEST(CountingGrid, SaturatesInsteadOfOverflowing) {
  CountingGrid counts(3, 16 << 20);
  const VoxelRun run{{1, 2, 3}, UINT32_MAX};
  counts.add(3, std::vector<VoxelRun>(3, run));
  counts.close();
  EXPECT_EQ(counts.count({3, {1, 2, 3}}), 0x7fffffffu);
}

}  // namespace
}  // namespace curvisplat
