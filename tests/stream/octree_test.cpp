#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "stream/base/error.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

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

// Voxels of a brick are 1/32 of its cell.
TEST(RootCube, HalvesNothingThinAtCoarseLevels) {
  for (const double thickness : {0.0, 1e-9, 0.003, 0.016, 0.0312}) {
    const glm::dvec3 lower(-1, 2, 3), upper(lower + glm::dvec3(thickness, 1, 0.7 * thickness));
    const RootCube root = RootCube::around(lower, upper);
    for (const int axis : {0, 2})
      for (uint32_t level = 0; level < 20 && root.cellSize(level) > upper[axis] - lower[axis]; ++level)
        EXPECT_EQ(Cell::of(root.fromWorld(lower), level).at[axis],
                  Cell::of(root.fromWorld(upper), level).at[axis])
            << thickness << ' ' << level;
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LE(root.min[axis], lower[axis]);
      EXPECT_GE(root.min[axis] + root.size, upper[axis]);
    }
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

/// The largest singular value by iteration. Converges in value for equal ones, too.
double spectralNorm(const glm::dmat3& a) {
  glm::dvec3 v(0.6, 0.5, 0.4);
  for (int n = 0; n < 3000; ++n) v = glm::normalize(glm::transpose(a) * (a * v));
  return glm::length(a * v);
}

/// Splats of one brick: cells of one kind, thin ones, long ones or cubes, with some noise; many are equal.
std::vector<Splat> someSplats(std::mt19937& random, double unit) {
  std::normal_distribution<double> normal;
  std::vector<Splat> splats(40);
  const glm::dvec3 kind = glm::exp(glm::dvec3(normal(random), normal(random), normal(random)) * 2.0);
  const double noise = random() % 3 == 0 ? 0 : random() % 2 == 0 ? 1e-9 : 0.1;
  for (size_t n = 0; n < splats.size(); ++n) {
    if (n % 3 == 2) {
      splats[n] = splats[n - 1];
      continue;
    }
    for (int axis = 0; axis < 3; ++axis) {
      splats[n].axis[static_cast<size_t>(axis)] = unit * kind[axis] * std::exp(noise * normal(random));
      splats[n].shear[static_cast<size_t>(axis)] = 0.4 + noise * normal(random);
    }
  }
  return splats;
}

TEST(ShapeExtent, IsThatOfTheExtremeSplat) {
  std::mt19937 random(3);
  for (int round = 0; round < 60; ++round) {
    const double unit = round % 3 == 0 ? 1e-150 : round % 3 == 1 ? 1 : 1e150;
    const std::vector<Splat> splats = someSplats(random, unit);
    double largest = 0, smallest = std::numeric_limits<double>::infinity();
    for (const Splat& splat : splats) {
      Splat scaled = splat;
      for (double& axis : scaled.axis) axis /= unit;
      const glm::dmat3 a = scaled.factor();
      largest = std::max(largest, spectralNorm(a));
      smallest = std::min(smallest, 1 / spectralNorm(glm::inverse(a)));
    }
    const double found_largest = largestSingularValue(splats) / unit,
                 found_smallest = smallestSingularValue(splats) / unit;
    EXPECT_GE(found_largest, largest * (1 - 1e-9));
    EXPECT_LE(found_largest, largest * (1 + 2e-6));
    EXPECT_LE(found_smallest, smallest * (1 + 1e-9));
    EXPECT_GE(found_smallest, smallest * (1 - 2e-6));
    for (const double slack : {0.001, 0.01, 0.5}) {
      const double about = smallestSingularValue(splats, slack) / unit;
      EXPECT_GE(about, found_smallest * (1 - 1e-12));
      EXPECT_LE(about, found_smallest * (1 + slack) * (1 + 1e-12));
    }
  }
}

}  // namespace
}  // namespace curvisplat
