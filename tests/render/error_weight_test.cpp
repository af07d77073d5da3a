#include "render/frame/error_weight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>

namespace curvisplat {
namespace {

TEST(ErrorWeight, IsAtMostFourPixelsWhereNothingShows) {
  EXPECT_EQ(leastErrorWeight(0), 1);
  EXPECT_EQ(leastErrorWeight(0.5), 0.25);
  EXPECT_EQ(leastErrorWeight(1), 0.25);
  EXPECT_EQ(leastErrorWeight(2), 0.5);
  EXPECT_EQ(leastErrorWeight(4), 1);
  EXPECT_EQ(leastErrorWeight(100), 1);
}

TEST(ErrorWeight, GrowsWithWhatShows) {
  EXPECT_EQ(errorWeight({}, 0.25), 0.25);
  EXPECT_EQ(errorWeight({.changed = 1}, 0.25), 1);
  EXPECT_EQ(errorWeight({.rippling = 50}, 0.25), 1);
  EXPECT_EQ(errorWeight({.share = 1.0 / 49}, 0.25), 0.25);
  EXPECT_EQ(errorWeight({.share = 1.0 / 47}, 0.25), 1);
  for (const double least : {0.25, 0.5}) {
    double changed = least, rippling = least;
    for (double depth = 1e-6; depth < 100; depth *= 1.7) {
      EXPECT_GE(errorWeight({.changed = depth}, least), changed);
      EXPECT_GE(errorWeight({.rippling = depth}, least), rippling);
      changed = errorWeight({.changed = depth}, least);
      rippling = errorWeight({.rippling = depth}, least);
      EXPECT_EQ(errorWeight({.changed = depth, .rippling = depth}, least), std::max(changed, rippling));
    }
    EXPECT_NEAR(changed, 1, 1e-12);
    EXPECT_NEAR(rippling, 1, 1e-12);
  }
}

/// No ray to the box is in step with the lattice for longer, and some is nearly as long.
TEST(ErrorWeight, LengthInStepIsThatOfTheRaysThroughTheBrick) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  const auto anywhere = [&](double size) {
    return size * glm::dvec3(2 * unit(random) - 1, 2 * unit(random) - 1, 2 * unit(random) - 1);
  };
  for (int n = 0; n < 200; ++n) {
    CutView view;
    view.perspective = n % 2 == 0;
    view.scale = {1, 0.5 + unit(random), 2};
    view.eye = anywhere(10);
    view.towards_viewer = glm::normalize(anywhere(1));
    if (n % 10 == 1) view.towards_viewer = {0, 0.6, 0.8};
    Brick brick;
    brick.lower = anywhere(2);
    brick.upper = brick.lower + glm::dvec3(0.3, 0.2, 0.4);
    const double voxel = 0.02, whole = 7, length = lengthInStep(brick, view, voxel, whole);
    EXPECT_LE(length, whole);
    double longest = 0;
    for (int m = 0; m < 500; ++m) {
      const glm::dvec3 point = view.scale * glm::mix(brick.lower, brick.upper,
                                                     glm::dvec3(unit(random), unit(random), unit(random)));
      const glm::dvec3 d =
          glm::abs(view.perspective ? glm::normalize(point - view.eye) : view.towards_viewer);
      longest = std::max(longest, std::min(whole, voxel / (std::numbers::pi * std::min({d.x, d.y, d.z}))));
    }
    EXPECT_GE(length, longest * (1 - 1e-9));
    if (!view.perspective) {
      EXPECT_NEAR(length, longest, 1e-9);
    }
  }
}

}  // namespace
}  // namespace curvisplat
