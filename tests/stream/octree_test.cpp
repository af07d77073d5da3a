#include "stream/model/octree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

TEST(RootCube, HoldsItsBoxAndRoundTrips) {
  const RootCube root = RootCube::around({-1, 2, 3}, {1, 2.5, 3.1});
  EXPECT_NEAR(root.size, 2.0, 1e-8);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int n = 0; n < 1000; ++n) {
    const glm::dvec3 world(-1 + 2 * unit(random), 2 + 0.5 * unit(random), 3 + 0.1 * unit(random));
    const glm::dvec3 back = root.toWorld(root.fromWorld(world));
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(back[axis], world[axis], 2.0 / (uint64_t{1} << 47));
    EXPECT_EQ(root.fromWorld(back), root.fromWorld(world));
  }
}

TEST(RootCube, OfAPointHasAnExtent) {
  EXPECT_EQ(RootCube::around({5, 5, 5}, {5, 5, 5}).size, 1.0);
}

TEST(RootCube, RefusesInfiniteBounds) {
  EXPECT_THROW(RootCube::around({0, 0, -INFINITY}, {1, 1, 1}), Error);
}

TEST(Cell, DescendsToTheCellOfAPosition) {
  std::mt19937_64 random(2);
  for (int n = 0; n < 1000; ++n) {
    RootPosition position;
    for (auto& at : position.at) at = random() >> (64 - kPositionBits);
    Cell cell;
    for (uint32_t level = 0; level < kMaxLevel; ++level) {
      ASSERT_TRUE(cell.contains(position));
      const Cell child = cell.child(octantOf(position, cell));
      ASSERT_EQ(child.parent(), cell);
      ASSERT_EQ(child.octantInParent(), octantOf(position, cell));
      cell = child;
    }
    ASSERT_EQ(cell, Cell::of(position, kMaxLevel));
  }
}

TEST(Cell, MortonOrderVisitsChildrenTogether) {
  std::vector<Cell> cells;
  for (uint32_t z = 0; z < 8; ++z)
    for (uint32_t y = 0; y < 8; ++y)
      for (uint32_t x = 0; x < 8; ++x) cells.push_back({3, {x, y, z}});
  std::sort(cells.begin(), cells.end(), mortonLess);
  for (size_t n = 0; n < cells.size(); ++n) {
    size_t code = 0;
    for (int bit = 2; bit >= 0; --bit)
      for (int axis = 2; axis >= 0; --axis) code = code * 2 + (cells[n].at[axis] >> bit & 1);
    EXPECT_EQ(code, n);
  }
}

}  // namespace
}  // namespace curvisplat
