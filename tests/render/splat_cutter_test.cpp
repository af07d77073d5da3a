#include "render/project/splat_cutter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <random>
#include <vector>

#include "render/project/projection.h"

namespace curvisplat {
namespace {

SplatPiece randomPiece(std::mt19937& random, float aspect) {
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  const auto axis = [&] { return std::pow(aspect, -unit(random)); };
  return {{around(random), around(random), around(random)},
          {axis(), axis(), axis(), around(random), around(random), around(random)},
          {around(random), around(random), around(random)},
          around(random),
          0.5f + unit(random)};
}

glm::dmat3 factorOf(const Shape& s) {
  return {s.axis0, s.axis0 * s.shear10, s.axis0 * s.shear20, 0, s.axis1, s.axis1 * s.shear21, 0, 0, s.axis2};
}

/// The moments of several splats with one residual variance: DESIGN.md, "Merging".
struct Moments {
  double weight = 0, mean = 0, square = 0;
  glm::dvec3 position{0.0}, slope{0.0};  // the slope as h = A w
  glm::dmat3 shape{0.0};

  explicit Moments(const std::vector<SplatPiece>& pieces) {
    for (const SplatPiece& piece : pieces) {
      weight += piece.weight;
      mean += double{piece.weight} * piece.mean;
      position += double{piece.weight} * glm::dvec3(piece.position);
    }
    mean /= weight;
    position /= weight;
    for (const SplatPiece& piece : pieces) {
      const double share = piece.weight / weight;
      const glm::dvec3 e = glm::dvec3(piece.position) - position,
                       w(piece.slope.w0, piece.slope.w1, piece.slope.w2);
      const double d = piece.mean - mean;
      const glm::dmat3 factor = factorOf(piece.shape);
      shape += share * (factor * glm::transpose(factor) + 12.0 * glm::outerProduct(e, e));
      slope += share * (factor * w + 12 * d * e);
      square += share * (glm::dot(w, w) / 12 + d * d);
    }
  }
};

void expectEqual(const Moments& a, const Moments& b, double tolerance) {
  EXPECT_NEAR(a.weight, b.weight, tolerance);
  EXPECT_NEAR(a.mean, b.mean, tolerance);
  EXPECT_NEAR(a.square, b.square, tolerance);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(a.position[i], b.position[i], tolerance);
    EXPECT_NEAR(a.slope[i], b.slope[i], tolerance);
    for (int j = 0; j < 3; ++j) EXPECT_NEAR(a.shape[i][j], b.shape[i][j], tolerance);
  }
}

TEST(SplatCutter, HalvesMergeIntoTheWhole) {
  std::mt19937 random(2);
  for (int n = 0; n < 300; ++n) {
    const SplatPiece whole = randomPiece(random, 100);
    const auto halves = halve(whole, n % 3);
    expectEqual(Moments({halves[0], halves[1]}), Moments({whole}), 1e-6);
  }
}

ScreenView viewFrom(const glm::dvec3& eye, double angle) {
  Camera camera;
  camera.position = eye;
  camera.focal_point = eye + glm::dvec3(0.2, 0.1, -1);
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = angle;
  return ScreenView::of(camera, {400, 400}, glm::dvec3(1), 1.5, 0.01);
}

TEST(SplatCutter, PiecesInSightAreSmallForTheirDistanceAndMergeIntoTheWhole) {
  std::mt19937 random(3);
  size_t most = 0;
  for (int n = 0; n < 50; ++n) {
    const SplatPiece whole = randomPiece(random, 30);
    // All of it in sight: far enough, and a wide angle.
    const PerspectiveMap map(viewFrom({0, 0, 9}, 140), glm::dvec3(0), 0.04f);
    std::vector<SplatPiece> pieces;
    size_t looks = 1'000'000;
    ASSERT_TRUE(cutUp(map, whole, looks, [&](const SplatPiece& piece, const PerspectiveMap::Centre& centre) {
      EXPECT_LE(map.radiusOf(piece.shape), map.widest * centre.z * 1.0001f);
      pieces.push_back(piece);
      return true;
    }));
    most = std::max(most, pieces.size());
    expectEqual(Moments(pieces), Moments({whole}), 2e-4);
  }
  EXPECT_GT(most, 1000u);
}

TEST(SplatCutter, APencilIsCutAcrossOnly) {
  SplatPiece pencil{};
  pencil.position = {0, 0, -0.3f};
  pencil.shape = {1e-3f, 1e-3f, 1.0f, 0, 0, 0};
  pencil.weight = 1;
  size_t pieces = 0, looks = 10'000;
  ASSERT_TRUE(cutUp(PerspectiveMap(viewFrom({0.05, 0, 0}, 60), glm::dvec3(0), 1), pencil, looks,
                    [&](const SplatPiece&, const PerspectiveMap::Centre&) { return ++pieces < 1000; }));
  EXPECT_GT(pieces, 3u);
  EXPECT_LT(pieces, 100u);
}

// Such splats are in no cache that conversion makes, and in any that somebody wants to hang a program with.
TEST(SplatCutter, EndsWhateverTheSize) {
  const ClassificationTable table([](double) { return TransferFunction::Value{glm::dvec3(1), 1.0}; }, 0, 1);
  for (const float size : {1e9f, 1e18f, 1e30f, 3e38f})
    for (const double near : {1e-3, 1e-300}) {
      SplatGeometry geometry;
      SplatVariable variable;
      geometry.resize(1);
      variable.resize(1);
      for (auto* array : {&geometry.axis0, &geometry.axis1, &geometry.axis2, &geometry.weight})
        (*array)[0] = size;
      geometry.shear10[0] = geometry.shear20[0] = geometry.shear21[0] = 1;
      variable.mean[0] = 0.5f;
      ProjectionSettings settings{viewFrom({0.1, 0.2, 0.3}, 60)};
      settings.view.near = near;
      BrickProjector projector;
      projector.project(settings, table, glm::dvec3(0), geometry, variable);
      EXPECT_LE(projector.splats().size(), BrickProjector::kMaxSplats);
    }
}

// A brick around the eye: nothing is smeared over the screen, nothing is not finite, and the number of pieces
// keeps its bound however many splats want to be cut.
TEST(Projection, FromWithinTheData) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> unit(0, 1);
  const size_t count = 20000;
  SplatGeometry geometry;
  SplatVariable variable;
  geometry.resize(count);
  variable.resize(count);
  for (size_t i = 0; i < count; ++i) {
    geometry.x[i] = unit(random), geometry.y[i] = unit(random), geometry.z[i] = unit(random);
    geometry.axis0[i] = geometry.axis1[i] = geometry.axis2[i] = 0.3f;
    geometry.shear10[i] = geometry.shear20[i] = geometry.shear21[i] = 0.1f;
    geometry.weight[i] = 0.01f;
    variable.mean[i] = 0.5f;
    variable.slope0[i] = variable.slope1[i] = variable.slope2[i] = 0.1f;
    variable.variance[i] = 0;
  }
  const ClassificationTable table([](double) { return TransferFunction::Value{glm::dvec3(1), 1}; }, 0, 1);
  BrickProjector projector;
  projector.project({viewFrom({0.5, 0.5, 0.5}, 60)}, table, glm::dvec3(0), geometry, variable);
  EXPECT_LE(projector.splats().size(), BrickProjector::kMaxSplats);
  EXPECT_GT(projector.counts().drawn, 1000u);
  EXPECT_GT(projector.counts().pieces, projector.counts().drawn);
  for (const ScreenSplat& splat : projector.splats()) {
    ASSERT_TRUE(std::isfinite(splat.x + splat.y + splat.l11 + splat.l21 + splat.l22 + splat.amplitude +
                              splat.slope0 + splat.slope1 + splat.half_width));
    ASSERT_GT(splat.amplitude, 0);
  }
}

}  // namespace
}  // namespace curvisplat
