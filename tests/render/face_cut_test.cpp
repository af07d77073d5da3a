#include "render/project/plane_cuts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/glm.hpp>
#include <random>

#include "render/project/footprint.h"

namespace curvisplat {
namespace {

constexpr float kLowPass2 = 1.5f;

struct Example {
  SplatPiece piece;
  ScreenRows rows;
  glm::dmat3 factor;
  glm::dmat3 view;  // columns: pixels per unit of x, y, z to the right, down and along the ray

  explicit Example(uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
    const auto axis = [&] { return std::pow(30.0f, -unit(random)); };
    const auto vector = [&] { return glm::vec3(around(random), around(random), around(random)); };
    const Shape shape{axis(), axis(), axis(), around(random), around(random), around(random)};
    piece = {vector(), shape, {around(random), around(random), around(random)}, around(random), 1};
    piece.faces.add({glm::normalize(vector()), 0.3f * around(random)});
    factor = {shape.axis0,
              shape.axis0 * shape.shear10,
              shape.axis0 * shape.shear20,
              0,
              shape.axis1,
              shape.axis1 * shape.shear21,
              0,
              0,
              shape.axis2};
    const glm::vec3 right = 20.0f * glm::normalize(vector());
    const glm::vec3 down = 20.0f * glm::normalize(glm::cross(right, vector()));
    rows = {right.x, right.y, right.z, down.x, down.y, down.z};
    view = {right, down, glm::cross(right, down) / 20.0f};
  }

  Ellipse ellipse() const { return ellipseOf(rows, piece.shape, piece.slope, 0, 1, {kLowPass2, 0.01f}); }
};

// The expected distance is from the shape's matrix and the face's normal in the world, as one would write it
// down.
TEST(FaceCut, IsTheConditionalDistanceFromTheFace) {
  int cut_ones = 0;
  for (uint32_t seed = 0; seed < 300; ++seed) {
    Example example(seed);
    const CutFace face = example.piece.faces.face[0];
    ScreenCut cut;
    const Ellipse ellipse = example.ellipse();
    if (cutAtFaces(example.rows, example.piece, ellipse, kLowPass2, cut) != Remains::kSome) continue;
    ++cut_ones;

    const glm::dvec3 normal = glm::inverse(glm::transpose(example.factor)) * glm::dvec3(face.inward);
    const glm::dmat3 shape = example.factor * glm::transpose(example.factor);
    const glm::dmat3 in_view = glm::transpose(example.view) * shape * example.view;
    const glm::dvec3 q = glm::transpose(example.view) * (shape * normal);
    glm::dmat2 screen(in_view[0][0] + kLowPass2, in_view[0][1], in_view[1][0], in_view[1][1] + kLowPass2);
    const glm::dvec2 slope = glm::inverse(screen) * glm::dvec2(q);
    const double variance =
        kKernelSigma * kKernelSigma * (glm::dot(normal, shape * normal) - glm::dot(glm::dvec2(q), slope));
    const double deviation = std::sqrt(variance);

    EXPECT_NEAR(cut.faces[0][0], face.distance / deviation, 1e-3 * (1 + std::abs(face.distance / deviation)));
    // Along the columns of L.
    const glm::dvec2 u0(ellipse.l11, ellipse.l21), u1(0, ellipse.l22);
    const double by0 = glm::dot(slope, u0) / deviation, by1 = glm::dot(slope, u1) / deviation;
    const double tolerance = 2e-3 * (1 + std::hypot(by0, by1));
    EXPECT_NEAR(cut.faces[0][1], by0, tolerance);
    EXPECT_NEAR(cut.faces[0][2], by1, tolerance);
    EXPECT_EQ(cut.far_sides == 1, glm::dot(normal, example.view[2]) > 0);
    // The scalar falls and rises with the depth: so much of its deviation is along the ray.
    const glm::dvec3 gradient =
        glm::inverse(glm::transpose(example.factor)) *
        glm::dvec3(example.piece.slope.w0, example.piece.slope.w1, example.piece.slope.w2);
    EXPECT_LE(std::abs(cut.correlation), 1);
    if (std::abs(cut.correlation) > 0.01f) {
      EXPECT_EQ(cut.correlation > 0, glm::dot(gradient, example.view[2]) > 0);
    }
    EXPECT_EQ(cut.faces[1][0], ScreenCut::kNoFace);
  }
  EXPECT_GT(cut_ones, 200);
}

// A splat along the axes, seen along z, has its scalar in three independent parts: the screen sees two of them, and the third
// goes with the depth. What the screen does not see is that part and the residual; the correlation is the part's share of the
// deviation. A face across the ray sees all of it.
TEST(FaceCut, HasTheCorrelationOfScalarAndDepth) {
  constexpr float kExact = 1e-6f;  // a low-pass that changes nothing
  const ScreenRows rows{10, 0, 0, 0, 10, 0};
  for (const float along : {-0.7f, 0.2f, 0.5f})
    for (const float variance : {0.0f, 0.04f, 0.3f})
      for (const float facing : {1.0f, -1.0f}) {
        SplatPiece piece{{0, 0, 0}, {1, 2, 0.5f, 0, 0, 0}, {0.4f, -0.3f, along}, 0, 1};
        piece.faces.add({{0, 0, facing}, 0.3f});
        const double deviation = kKernelSigma * along;
        const double expected = deviation / std::sqrt(deviation * deviation + variance);
        const Ellipse ellipse = ellipseOf(rows, piece.shape, piece.slope, variance, 1, {kExact, kExact});
        ScreenCut cut;
        ASSERT_EQ(cutAtFaces(rows, piece, ellipse, kExact, cut), Remains::kSome);
        EXPECT_NEAR(cut.correlation, expected, 1e-4) << along << ' ' << variance << ' ' << facing;
        const ScreenDepth depth = depthAlongRay(rows, {0, 0, 1}, 0, piece, ellipse, kExact);
        EXPECT_NEAR(depth.correlation, expected, 1e-4) << along << ' ' << variance;
      }
}

TEST(FaceCut, LeavesAllOrNothingFarFromTheFace) {
  Example example(5);
  ScreenCut cut;
  example.piece.faces.face[0].distance = 100;
  EXPECT_EQ(cutAtFaces(example.rows, example.piece, example.ellipse(), kLowPass2, cut), Remains::kAll);
  example.piece.faces.face[0].distance = -100;
  EXPECT_EQ(cutAtFaces(example.rows, example.piece, example.ellipse(), kLowPass2, cut), Remains::kNothing);
  example.piece.faces.count = 0;
  EXPECT_EQ(cutAtFaces(example.rows, example.piece, example.ellipse(), kLowPass2, cut), Remains::kAll);
}

// The step at a face that is seen edge-on is as wide as the low-pass makes it, however large the splat.
TEST(FaceCut, IsAntialiasedEdgeOn) {
  for (const float size : {10.0f, 1000.0f, 1e5f}) {
    SplatPiece piece{{0, 0, 0}, {size, size, size, 0, 0, 0}, {0, 0, 0}, 0, 1};
    piece.faces.add({{1, 0, 0}, 0});
    const ScreenRows rows{1, 0, 0, 0, 1, 0};
    ScreenCut cut;
    ASSERT_EQ(cutAtFaces(rows, piece, ellipseOf(rows, piece.shape, piece.slope, 0, 1, {kLowPass2, 0.01f}),
                         kLowPass2, cut),
              Remains::kSome);
    const double step_px = size / cut.faces[0][1];  // a deviation
    EXPECT_NEAR(step_px, kKernelSigma * std::sqrt(kLowPass2), 0.02) << size;
  }
}

TEST(FaceCut, OfTheNextLayerIsLeftOutWhereItIsSeenFaceOn) {
  const ScreenRows rows{10, 0, 0, 0, 10, 0};
  for (const bool edge_on : {true, false})
    for (const glm::vec3& inward : {glm::vec3(0, 0, 1), glm::vec3(1, 0, 0)}) {
      SplatPiece piece{{0, 0, 0}, {1, 1, 1, 0, 0, 0}, {0, 0, 0}, 0, 1};
      piece.faces.add({inward, 0.8f, edge_on});
      ScreenCut cut;
      const Ellipse ellipse = ellipseOf(rows, piece.shape, piece.slope, 0, 1, {kLowPass2, 0.01f});
      EXPECT_EQ(cutAtFaces(rows, piece, ellipse, kLowPass2, cut),
                edge_on && inward.z == 1 ? Remains::kAll : Remains::kSome);
    }
}

TEST(ScreenCut, IsARecordThatIsNotASplat) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> around(-1, 1);
  for (int n = 0; n < 1000; ++n) {
    ScreenCut cut;
    for (auto& face : cut.faces) face = {1e4f * around(random), around(random), 30 * around(random)};
    cut.far_sides = random() % 8;
    cut.correlation = n % 3 == 0 ? static_cast<float>(n % 2 * 2 - 1) : around(random);
    const ScreenSplat record = cut.record();
    EXPECT_TRUE(isRecord(record));
    EXPECT_FALSE(hasCut(record));
    const ScreenCut back = ScreenCut::of(record);
    EXPECT_EQ(back.faces, cut.faces);
    EXPECT_EQ(back.far_sides, cut.far_sides);
    EXPECT_NEAR(back.correlation, cut.correlation, 4e-6);
  }
}

}  // namespace
}  // namespace curvisplat
