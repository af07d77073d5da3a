#include "preprocess/scenes/scenes.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>
#include <set>

#include "stream/base/error.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

// The volume of the unit cube's image: the integral of |det J| by central differences, midpoint rule.
double volumeByJacobians(const Scene& scene, int n, int layers) {
  double volume = 0;
  const double half = 0.5 / n, half_layer = 0.5 / layers;
  for (int k = 0; k < layers; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const glm::dvec3 at((i + 0.5) / n, (j + 0.5) / n, (k + 0.5) / layers);
        const auto along = [&](const glm::dvec3& step) {
          return scene.position(at + step) - scene.position(at - step);
        };
        const glm::dvec3 du = along({half, 0, 0}), dv = along({0, half, 0}), dw = along({0, 0, half_layer});
        volume += std::abs(glm::dot(glm::cross(du, dv), dw));
      }
  return volume;
}

class EveryScene : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene, testing::ValuesIn(sceneNames()), [](const auto& scene) {
  std::string name = scene.param;
  std::erase(name, '-');
  return name;
});

TEST_P(EveryScene, IsTheInverseOfItsPositions) {
  for (const auto& scene : makeScenes(GetParam())) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> unit(0.001, 0.999);
    for (int n = 0; n < 2000; ++n) {
      const glm::dvec3 uvw(unit(random), unit(random), unit(random));
      const auto back = scene->inverse(scene->position(uvw));
      ASSERT_TRUE(back.has_value()) << uvw.x << " " << uvw.y << " " << uvw.z;
      // A wall cell is e^-9 of the others: a rounding error there is worth that much more of v.
      for (int axis = 0; axis < 3; ++axis) ASSERT_NEAR((*back)[axis], uvw[axis], 1e-10);
    }
  }
}

TEST_P(EveryScene, HasTheVolumeItSays) {
  const bool bent_along_w =
      GetParam() == "dome" || GetParam() == "globe" || GetParam() == "spectral" || GetParam() == "ocean";
  const int fine = !bent_along_w ? 400 : GetParam() == "dome" ? 240 : 150;
  for (const auto& scene : makeScenes(GetParam()))
    EXPECT_NEAR(volumeByJacobians(*scene, fine, bent_along_w ? fine / 4 : 4) / scene->volume(), 1, 1e-3);
}

TEST_P(EveryScene, TouchesAndKeepsItsBounds) {
  for (const auto& scene : makeScenes(GetParam())) {
    const auto [lower, upper] = scene->bounds();
    glm::dvec3 least(1e9), most(-1e9);
    for (int i = 0; i <= 120; ++i)
      for (int j = 0; j <= 10; ++j)
        for (int k = 0; k <= 2; ++k) {
          const glm::dvec3 p = scene->position({i / 120.0, j / 10.0, k / 2.0});
          least = glm::min(least, p);
          most = glm::max(most, p);
        }
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(least[axis], lower[axis], 5e-3);
      EXPECT_NEAR(most[axis], upper[axis], 5e-3);
      EXPECT_GE(least[axis], lower[axis] - 1e-12);
      EXPECT_LE(most[axis], upper[axis] + 1e-12);
    }
  }
}

TEST_P(EveryScene, HasAScalarWithinItsRange) {
  for (const auto& scene : makeScenes(GetParam())) {
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int n = 0; n < 2000; ++n) {
      const double f = scene->scalar(scene->position({unit(random), unit(random), unit(random)}));
      ASSERT_GE(f, 0);
      ASSERT_LE(f, 1);
    }
  }
}

TEST(HalfAnnulus, HasItsDefinedPositionsAndScalar) {
  const auto scene = makeScene("half-annulus", 5);
  const double u = 0.3, v = 0.7, w = 0.6;
  const double theta = std::numbers::pi * u;
  const double r = 0.3 + 0.7 * (std::exp(5 * v) - 1) / (std::exp(5.0) - 1);
  const glm::dvec3 expected(-r * std::sin(theta), r * std::cos(theta), w + 0.15 * r * std::sin(3 * theta));
  EXPECT_LT(glm::distance(scene->position({u, v, w}), expected), 1e-14);
  // At the centre of the wide blob: 0.2 + 1 and what the others add is clamped.
  EXPECT_EQ(scene->scalar({-0.5, 0.3, 0.5}), 1);
  const double narrow_d2 = 0.16 + 0.16 + 0.09, wide_d2 = 0.25 + 0.09 + 0.25;
  EXPECT_NEAR(scene->scalar({0, 0, 0}), 0.2 + std::exp(-8 * wide_d2) + 0.8 * std::exp(-20 * narrow_d2),
              1e-15);
}

TEST(HalfAnnulus, EndsAtItsFaces) {
  const auto scene = makeScene("half-annulus");
  EXPECT_TRUE(scene->contains({-0.301, 0, 0.5}));
  EXPECT_FALSE(scene->contains({-0.299, 0, 0.5}));
  EXPECT_TRUE(scene->contains({-0.999, 0, 0.5}));
  EXPECT_FALSE(scene->contains({-1.001, 0, 0.5}));
  EXPECT_FALSE(scene->contains({0.001, 0.5, 0.5}));
  // At theta = pi / 2 the floor is 0.15 r below.
  EXPECT_TRUE(scene->contains({-0.5, 0, -0.074}));
  EXPECT_FALSE(scene->contains({-0.5, 0, -0.076}));
  EXPECT_FALSE(scene->contains({-0.5, 0, 0.926}));
}

TEST(Wake, ClosesOnItselfExactly) {
  SceneGridSource grid(makeScene("wake"), {17, 9, 3});
  NodeArrays nodes;
  grid.read(0, {0, 9, 0, 3}, std::vector<uint32_t>{0}, nodes);
  for (size_t row = 0; row < 27; ++row) {
    const size_t first = row * 17, last = first + 16;
    EXPECT_EQ(nodes.x[first], nodes.x[last]);
    EXPECT_EQ(nodes.y[first], nodes.y[last]);
    EXPECT_EQ(nodes.z[first], nodes.z[last]);
    EXPECT_EQ(nodes.scalars[0][first], nodes.scalars[0][last]);
  }
}

TEST(Wake, HasThinWallCells) {
  const auto scene = makeScene("wake");
  const auto length = [&](double v0, double v1) {
    return glm::distance(scene->position({0.25, v0, 0}), scene->position({0.25, v1, 0}));
  };
  const double ratio = length(0, 1e-3) / length(1 - 1e-3, 1);
  EXPECT_GT(ratio, 1e-5);
  EXPECT_LT(ratio, 2e-4);
}

/// The nodes that are the last of one block along an axis, or the first, and lie where nodes of another block do.
size_t sharedNodes(const SceneGridSource& grid, SceneGridSize size) {
  std::vector<std::set<std::array<double, 3>>> places;
  for (uint32_t block = 0; block < grid.description().blocks.size(); ++block) {
    NodeArrays nodes;
    grid.read(block, {0, size.nj, 0, size.nk}, {}, nodes);
    auto& own = places.emplace_back();
    for (size_t n = 0; n < nodes.x.size(); ++n) own.insert({nodes.x[n], nodes.y[n], nodes.z[n]});
  }
  size_t shared = 0;
  for (size_t a = 0; a < places.size(); ++a)
    for (size_t b = a + 1; b < places.size(); ++b)
      for (const auto& place : places[a]) shared += places[b].count(place);
  return shared;
}

TEST(RoughScenes, BlocksShareTheNodesOfTheirFacesExactly) {
  // Twelve edges of the cube, each a face of 9 x 3 nodes; at each of the eight corners three blocks meet, which
  // makes three pairs, as the three edges there count them.
  EXPECT_EQ(sharedNodes(SceneGridSource(makeScenes("globe"), {9, 9, 3}), {9, 9, 3}), 12u * 9 * 3);
  EXPECT_EQ(sharedNodes(SceneGridSource(makeScenes("duct"), {6, 5, 4}), {6, 5, 4}), 2u * 5 * 4);
}

TEST(RoughScenes, DomesCellsGrowByAHalf) {
  const auto dome = makeScene("dome");
  const auto radius = [&](int j) { return glm::length(dome->position({0.1, j / 24.0, 0.3})); };
  for (int j = 1; j < 24; ++j)
    EXPECT_NEAR((radius(j + 1) - radius(j)) / (radius(j) - radius(j - 1)), 1.5, 1e-9);
  EXPECT_EQ(dome->position({0.3, 0.7, 1}).z, 0);
}

TEST(SceneGridSource, ReadsTheSameNodesInAnyBox) {
  const SceneGridSource grid(makeScene("half-annulus"), {5, 6, 7}, 4);
  const std::vector<uint32_t> scalars{0};
  NodeArrays all, part;
  grid.read(0, {0, 6, 0, 7}, scalars, all);
  ASSERT_EQ(all.x.size(), 5u * 6 * 7);
  grid.read(0, {2, 4, 3, 6}, scalars, part);
  ASSERT_EQ(part.x.size(), 5u * 2 * 3);
  size_t n = 0;
  for (size_t k = 3; k < 6; ++k)
    for (size_t j = 2; j < 4; ++j)
      for (size_t i = 0; i < 5; ++i, ++n) {
        const size_t m = (k * 6 + j) * 5 + i;
        EXPECT_EQ(part.x[n], all.x[m]);
        EXPECT_EQ(part.y[n], all.y[m]);
        EXPECT_EQ(part.z[n], all.z[m]);
        EXPECT_EQ(part.blank[n], 0);
        EXPECT_EQ(part.scalars[0][n], all.scalars[0][m]);
        EXPECT_EQ(all.x[m], static_cast<float>(all.x[m]));
      }
  const glm::dvec3 corner = makeScene("half-annulus")->position({1, 1, 1});
  EXPECT_NEAR(all.y.back(), corner.y, 1e-7);
}

TEST(MakeScene, RefusesUnknownScenesAndOptions) {
  try {
    makeScene("pipe");
    FAIL();
  } catch (const UsageError& error) {
    expectSays(error.what(), "half-annulus, half-annulus-constant, shell, ");
  }
  EXPECT_THROW(makeScene("wake", 0), UsageError);
  EXPECT_THROW(makeScene("sheared-waves", 2), UsageError);
  EXPECT_THROW(makeScene("wake", std::nan("")), UsageError);
  EXPECT_THROW(SceneGridSource(makeScene("wake"), {1, 9, 9}), UsageError);
}

}  // namespace
}  // namespace curvisplat
