#include "stream/model/shape_extent.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <random>
#include <vector>

namespace curvisplat {
namespace {

/// By iteration. Converges in value for equal ones, too.
double largestSingular(const glm::dmat3& a) {
  glm::dvec3 v(0.6, 0.5, 0.4);
  for (int n = 0; n < 3000; ++n) v = glm::normalize(glm::transpose(a) * (a * v));
  return glm::length(a * v);
}

/// Of one brick: cells of one kind, thin ones, long ones or cubes, with some noise; many are equal.
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
      largest = std::max(largest, largestSingular(a));
      smallest = std::min(smallest, 1 / largestSingular(glm::inverse(a)));
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
