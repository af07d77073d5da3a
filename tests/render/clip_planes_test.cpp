#include "render/project/clip_planes.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "render/project/face_cut.h"
#include "render/project/kernel.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"
#include "tests/reference/splat_arrays.h"

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

}  // namespace
}  // namespace curvisplat
