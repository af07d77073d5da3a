#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <glm/glm.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "render/project/footprint.h"
#include "render/project/plane_cuts.h"
#include "render/project/projection.h"
#include "render/project/splat_pieces.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"
#include "tests/reference/splat_compositor.h"

namespace curvisplat {
namespace {

/// Splats of unit cells, at these places along x.
SplatGeometry unitSplats(const std::vector<float>& x, uint32_t border_code = kNoBorder) {
  SplatGeometry geometry;
  geometry.resize(x.size());
  for (size_t n = 0; n < x.size(); ++n) {
    geometry.x[n] = x[n];
    geometry.y[n] = geometry.z[n] = 0;
    geometry.axis0[n] = geometry.axis1[n] = geometry.axis2[n] = 1;
    geometry.shear10[n] = geometry.shear20[n] = geometry.shear21[n] = 0;
    geometry.weight[n] = 1;
    geometry.border_code[n] = border_code;
  }
  return geometry;
}

std::vector<ClipSide> sidesOf(const LocalClipPlanes& clip, const SplatGeometry& geometry) {
  std::vector<ClipSide> sides(geometry.size());
  clip.sidesOf(arraysOf(geometry), 0, geometry.size(), sides);
  return sides;
}

TEST(ClipPlanes, TellSplatsApartByTheirWholeSupport) {
  // The plane x = 10, from a brick at 7; the normal's length does not matter.
  const ClipPlane plane{{10, 5, 5}, {4, 0, 0}};
  const LocalClipPlanes clip({&plane, 1}, {7, 0, 0});
  const auto reach = static_cast<float>(kKernelSupport);
  const auto sides = sidesOf(
      clip, unitSplats({3 - reach - 0.01f, 3 - reach + 0.01f, 3, 3 + reach - 0.01f, 3 + reach + 0.01f}));
  EXPECT_EQ(sides, (std::vector<ClipSide>{ClipSide::kOutside, ClipSide::kAcross, ClipSide::kAcross,
                                          ClipSide::kAcross, ClipSide::kInside}));
}

TEST(ClipPlanes, TakeCellsAtBordersForAsWideAsTheyAreDrawn) {
  const ClipPlane plane{{0, 0, 0}, {-1, 0, 0}};
  const LocalClipPlanes clip({&plane, 1}, glm::dvec3(0));
  const glm::dvec3 inward(1, 0, 0);
  const uint32_t at_border = packBorderCode({&inward, 1}, 1);
  EXPECT_EQ(sidesOf(clip, unitSplats({-2}))[0], ClipSide::kInside);
  EXPECT_EQ(sidesOf(clip, unitSplats({-2}, at_border))[0], ClipSide::kAcross);
}

TEST(ClipPlanes, OfSeveralTheWorstSideCounts) {
  const ClipPlane planes[] = {{{0, 0, 0}, {1, 0, 0}}, {{5, 0, 0}, {-1, 0, 0}}};
  const LocalClipPlanes clip(planes, glm::dvec3(0));
  EXPECT_EQ(sidesOf(clip, unitSplats({-3, 0, 2.5f, 5, 8})),
            (std::vector<ClipSide>{ClipSide::kOutside, ClipSide::kAcross, ClipSide::kInside,
                                   ClipSide::kAcross, ClipSide::kOutside}));
  EXPECT_TRUE(clip.contains({1, 9, 9}));
  EXPECT_FALSE(clip.contains({-1, 0, 0}));
  EXPECT_FALSE(clip.contains({6, 0, 0}));
}

TEST(ClipPlanes, OfABoxAreItsFaces) {
  const ClipPlane plane{{0, 0, 0}, {1, 1, 0}};
  const auto planes = clipPlanesOf({&plane, 1}, WorldBox{{1, 2, 3}, {4, 5, 6}});
  ASSERT_EQ(planes.size(), 7u);
  const LocalClipPlanes clip(planes, glm::dvec3(0));
  EXPECT_TRUE(clip.contains({2, 3, 4}));
  for (const glm::vec3& outside : {glm::vec3(0.9f, 3, 4), glm::vec3(4.1f, 3, 4), glm::vec3(2, 1.9f, 4),
                                   glm::vec3(2, 5.1f, 4), glm::vec3(2, 3, 2.9f), glm::vec3(2, 3, 6.1f)})
    EXPECT_FALSE(clip.contains(outside));
}

TEST(ClipPlanes, BecomeFacesInTheFrameOfThePiece) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> around(-1, 1);
  for (int n = 0; n < 100; ++n) {
    SplatPiece piece{};
    piece.position = {around(random), around(random), around(random)};
    piece.shape = {1.5f + around(random), 1.5f + around(random), 1.5f + around(random),
                   around(random),        around(random),        around(random)};
    const ClipPlane plane{{0.2 * around(random), 0.2 * around(random), 0.2 * around(random)},
                          {around(random), around(random), around(random)}};
    const LocalClipPlanes clip({&plane, 1}, glm::dvec3(0));
    clip.addFaces(piece);
    if (piece.faces.count == 0) continue;
    const CutFace& face = piece.faces.face[0];
    // A point A u of the piece lies on the side that its u has of the face.
    for (int m = 0; m < 10; ++m) {
      const glm::vec3 u(2 * around(random), 2 * around(random), 2 * around(random));
      const Shape& s = piece.shape;
      const glm::vec3 x =
          piece.position + glm::vec3(s.axis0 * u.x, s.axis0 * s.shear10 * u.x + s.axis1 * u.y,
                                     s.axis0 * s.shear20 * u.x + s.axis1 * s.shear21 * u.y + s.axis2 * u.z);
      const float by_face = glm::dot(face.inward, u) + face.distance;
      if (std::abs(by_face) > 1e-4f) {
        EXPECT_EQ(by_face > 0, clip.contains(x));
      }
    }
  }
}

TEST(ClipPlanes, KeepTheFacesThatTakeMost) {
  CutFaces faces;
  for (const float distance : {0.5f, -0.25f, 1.0f, 0.75f, 0.0f, 0.3f, -0.5f, 1.25f})
    faces.add({{1, 0, 0}, distance});
  ASSERT_EQ(faces.count, CutFaces::kMax);
  std::vector<float> kept;
  for (const CutFace& face : faces) kept.push_back(face.distance);
  std::sort(kept.begin(), kept.end());
  EXPECT_EQ(kept, (std::vector<float>{-0.5f, -0.25f, 0, 0.3f, 0.5f, 0.75f}));
}

TEST(ClipPlanes, NeedADirection) {
  EXPECT_TRUE(isUsable({{0, 0, 0}, {0, 1e-6, 0}}));
  EXPECT_FALSE(isUsable({{0, 0, 0}, {0, 0, 0}}));
  EXPECT_FALSE(isUsable({{0, 0, 0}, {INFINITY, 0, 0}}));
}

SplatPiece randomPiece(std::mt19937& random, float aspect) {
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  const auto axis = [&] { return std::pow(aspect, -unit(random)); };
  return {{around(random), around(random), around(random)},
          {axis(), axis(), axis(), around(random), around(random), around(random)},
          {around(random), around(random), around(random)},
          around(random),
          0.5f + unit(random)};
}

glm::dmat3 factorOfPiece(const Shape& s) {
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
      const glm::dmat3 factor = factorOfPiece(piece.shape);
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

ScreenView perspectiveFrom(const glm::dvec3& eye, double angle) {
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
    const PerspectiveMap map(perspectiveFrom({0, 0, 9}, 140), glm::dvec3(0), 0.04f);
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
  ASSERT_TRUE(cutUp(PerspectiveMap(perspectiveFrom({0.05, 0, 0}, 60), glm::dvec3(0), 1), pencil, looks,
                    [&](const SplatPiece&, const PerspectiveMap::Centre&) { return ++pieces < 1000; }));
  EXPECT_GT(pieces, 3u);
  EXPECT_LT(pieces, 100u);
}

// Splats of such sizes are in no cache that conversion makes, and in any that somebody wants to hang a
// program with.
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
      ProjectionSettings settings{perspectiveFrom({0.1, 0.2, 0.3}, 60)};
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
  projector.project({perspectiveFrom({0.5, 0.5, 0.5}, 60)}, table, glm::dvec3(0), geometry, variable);
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
