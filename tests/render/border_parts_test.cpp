#include "render/project/border_parts.h"

#include <gtest/gtest.h>

#include <glm/glm.hpp>
#include <random>
#include <vector>

#include "render/colour/transfer_function.h"
#include "render/project/projection.h"
#include "stream/model/border_code.h"
#include "tests/reference/splat_arrays.h"

namespace curvisplat {
namespace {

glm::dmat3 factorOf(const Shape& s) {
  return {s.axis0, s.axis0 * s.shear10, s.axis0 * s.shear20, 0, s.axis1, s.axis1 * s.shear21, 0, 0, s.axis2};
}
glm::dvec3 vectorOf(const Slope& w) {
  return {w.w0, w.w1, w.w2};
}

const SplatPiece kWhole{{1, 2, 3}, {0.5f, 0.02f, 2, 0.3f, -1, 0.7f}, {0.4f, -0.2f, 0.1f}, 5, 0.02f};
const glm::dvec3 kInward[] = {glm::normalize(glm::dvec3(1, 2, -1)), glm::normalize(glm::dvec3(1, 0, 1)),
                              glm::normalize(glm::dvec3(-1, 1, 1))};

TEST(BorderParts, OfAWholeCellAreItself) {
  BorderPieces pieces;
  ASSERT_EQ(partsAtBorder(kWhole, kNoBorder, kHalfCellStyle, pieces), 1u);
  EXPECT_EQ(pieces[0].position, kWhole.position);
  EXPECT_EQ(factorOf(pieces[0].shape), factorOf(kWhole.shape));
  EXPECT_EQ(pieces[0].weight, kWhole.weight);
  EXPECT_EQ(pieces[0].mean, kWhole.mean);
}

TEST(BorderParts, AreStretchedAndShiftedAlongTheInwardAxesOnly) {
  const glm::dmat3 a = factorOf(kWhole.shape);
  for (size_t axes = 1; axes <= 3; ++axes) {
    const BorderStyle& style = axes == 2 ? kWholeCellStyle : kHalfCellStyle;
    const uint32_t code = packBorderCode({kInward, axes});
    const InwardAxes inward = inwardAxes(code);
    BorderPieces pieces;
    ASSERT_EQ(partsAtBorder(kWhole, code, style, pieces), size_t{1} << axes);
    double weight = 0;
    for (size_t n = 0; n < size_t{1} << axes; ++n) {
      glm::dmat3 m(1.0);
      glm::dvec3 offset(0.0);
      for (size_t axis = 0; axis < axes; ++axis) {
        const BorderPart& part = style.parts[n >> axis & 1];
        const glm::dvec3 q(inward.axis[axis]);
        m += (double{part.size} * part.size - 1) * glm::outerProduct(q, q);
        offset += double{part.offset} * q;
      }
      const SplatPiece& piece = pieces[n];
      const glm::dmat3 factor = factorOf(piece.shape);
      const glm::dmat3 found = factor * glm::transpose(factor), expected = a * m * glm::transpose(a);
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) EXPECT_NEAR(found[i][j], expected[i][j], 1e-5);
      EXPECT_LT(glm::distance(glm::dvec3(piece.position), glm::dvec3(kWhole.position) + a * offset), 1e-5);
      weight += piece.weight;
    }
    EXPECT_NEAR(weight, kWhole.weight, 1e-7);
  }
}

TEST(BorderParts, CarryTheSameLinearField) {
  // The gradient is A⁻ᵀ w, whatever A.
  const glm::dvec3 gradient = glm::inverse(glm::transpose(factorOf(kWhole.shape))) * vectorOf(kWhole.slope);
  for (const BorderStyle& style : {kHalfCellStyle, kWholeCellStyle}) {
    BorderPieces pieces;
    const size_t count = partsAtBorder(kWhole, packBorderCode({kInward, 3}), style, pieces);
    for (size_t n = 0; n < count; ++n) {
      const SplatPiece& piece = pieces[n];
      const glm::dvec3 found = glm::inverse(glm::transpose(factorOf(piece.shape))) * vectorOf(piece.slope);
      EXPECT_LT(glm::distance(found, gradient), 1e-4 * glm::length(gradient));
      const double mean = kWhole.mean + glm::dot(gradient, glm::dvec3(piece.position - kWhole.position));
      EXPECT_NEAR(piece.mean, mean, 1e-5);
    }
  }
}

TEST(BorderParts, AtFacesAreOneThatIsCutThere) {
  const glm::dmat3 a = factorOf(kWhole.shape);
  for (size_t axes = 1; axes <= 3; ++axes) {
    const BorderStyle& style = axes == 2 ? kWholeCellStyle : kHalfCellStyle;
    const uint32_t faces = axes == 3 ? 5 : (1u << axes) - 1;  // the second of three in parts
    const uint32_t code = packBorderCode({kInward, axes}, faces);
    const InwardAxes inward = inwardAxes(code);
    BorderPieces pieces;
    ASSERT_EQ(partsAtBorder(kWhole, code, style, pieces), axes == 3 ? 2u : 1u);
    for (size_t n = 0; n < (axes == 3 ? 2 : 1); ++n) {
      const SplatPiece& piece = pieces[n];
      ASSERT_EQ(piece.faces.count, axes == 3 ? 2 : static_cast<int>(axes));
      const glm::dmat3 to_frame = glm::inverse(factorOf(piece.shape));
      double share = axes == 3 ? style.parts[n].share : 1;
      int found = 0;
      for (size_t axis = 0; axis < axes; ++axis) {
        if (!inward.hasFace(static_cast<int>(axis))) continue;
        const CutFace& face = piece.faces.face[static_cast<size_t>(found++)];
        share *= style.cut.share;
        EXPECT_NEAR(glm::length(face.inward), 1, 1e-5);
        // The face lies half a cell from the cell's middle, along the other axes; wherever it is looked at.
        const glm::dvec3 q(inward.axis[axis]), other(inward.axis[(axis + 1) % 3]);
        for (const double away : {-1.0, 0.0, 2.0}) {
          const glm::dvec3 on_face =
              glm::dvec3(kWhole.position) + a * (-0.5 * q + away * glm::cross(q, other));
          const glm::dvec3 u = to_frame * (on_face - glm::dvec3(piece.position));
          EXPECT_NEAR(glm::dot(glm::dvec3(face.inward), u), -face.distance, 1e-4);
        }
        const glm::dvec3 inside = to_frame * (glm::dvec3(kWhole.position) - glm::dvec3(piece.position));
        EXPECT_GT(glm::dot(glm::dvec3(face.inward), inside), -face.distance);
      }
      EXPECT_NEAR(piece.weight, kWhole.weight * share, 1e-6);
    }
  }
}

TEST(BorderParts, InTheLayerBehindAFaceAreItselfCutThere) {
  BorderPieces pieces;
  ASSERT_EQ(partsAtBorder(kWhole, packLayerCode(kInward[0], 0.75), kHalfCellStyle, pieces), 1u);
  EXPECT_EQ(pieces[0].position, kWhole.position);
  EXPECT_EQ(factorOf(pieces[0].shape), factorOf(kWhole.shape));
  EXPECT_EQ(pieces[0].weight, kWhole.weight);
  ASSERT_EQ(pieces[0].faces.count, 1);
  EXPECT_EQ(pieces[0].faces.face[0].distance, 0.75f);
  EXPECT_LT(glm::distance(glm::dvec3(pieces[0].faces.face[0].inward), kInward[0]), 0.02);
}

TEST(BorderParts, KeepTheirFacesWhereTheyAreHalved) {
  BorderPieces pieces;
  partsAtBorder(kWhole, packBorderCode({kInward, 2}, 3), kHalfCellStyle, pieces);
  const SplatPiece& piece = pieces[0];
  for (int column = 0; column < 3; ++column)
    for (const SplatPiece& half : halve(piece, column)) {
      ASSERT_EQ(half.faces.count, 2);
      for (size_t n = 0; n < 2; ++n) {
        const glm::dvec3 inward(piece.faces.face[n].inward);
        for (const glm::dvec3& along : {glm::dvec3(0), glm::cross(inward, glm::dvec3(1, 0, 0))}) {
          const glm::dvec3 on_face =
              glm::dvec3(piece.position) +
              factorOf(piece.shape) * (-double{piece.faces.face[n].distance} * inward + along);
          const glm::dvec3 u = glm::inverse(factorOf(half.shape)) * (on_face - glm::dvec3(half.position));
          EXPECT_NEAR(glm::dot(glm::dvec3(half.faces.face[n].inward), u), -half.faces.face[n].distance, 1e-4);
        }
      }
    }
}

/// A brick of `count` equal splats.
struct Brick {
  SplatGeometry geometry;
  SplatVariable variable;

  Brick(size_t count, uint32_t border_code) {
    geometry.resize(count);
    variable.resize(count);
    Splat splat;
    splat.axis = {0.1, 0.1, 0.1};
    splat.weight = 1e-3;
    for (size_t n = 0; n < count; ++n)
      setSplat({geometry, variable}, n, {0.5, 0.5, 0.5}, splat, {0.5, {0.1, 0, 0}, 0}, {border_code});
  }
};

ProjectionCounts project(const Brick& brick, Projection projection) {
  Camera camera;
  camera.position = {0.5, 0.5, 4};
  camera.focal_point = {0.5, 0.5, 0};
  camera.projection = projection;
  ProjectionSettings settings;
  settings.view = ScreenView::of(camera, {64, 64}, glm::dvec3(1), kLowPass, 0.01);
  const auto table = ClassificationTable::of(TransferFunction::preset("grey", 0, 1, 1), 0, 1);
  BrickProjector projector;
  projector.project(settings, table, glm::dvec3(0), brick.geometry, brick.variable);
  return projector.counts();
}

TEST(BorderParts, AreWhatHalfCellsAreDrawnAs) {
  const uint32_t corner = packBorderCode({kInward, 3});
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    const ProjectionCounts one = project(Brick(1, packBorderCode({kInward, 1})), projection);
    EXPECT_EQ(one.drawn, 1u);
    EXPECT_EQ(one.pieces, 2u);
    EXPECT_EQ(project(Brick(10, corner), projection).pieces, 80u);
    EXPECT_EQ(project(Brick(10, kNoBorder), projection).pieces, 10u);
  }
}

TEST(BorderParts, AtAFaceAreASplatAndItsCut) {
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    const ProjectionCounts one = project(Brick(7, packBorderCode({kInward, 2}, 3)), projection);
    EXPECT_EQ(one.drawn, 7u);
    EXPECT_EQ(one.pieces, 14u);
  }
}

TEST(BorderParts, AreNotDrawnWhereABrickHasTooMany) {
  const uint32_t corner = packBorderCode({kInward, 3});
  const size_t count = BrickProjector::kMaxPieces / 8;
  EXPECT_EQ(project(Brick(count, corner), Projection::kOrthographic).pieces, 8 * count);
  EXPECT_EQ(project(Brick(count + 1, corner), Projection::kOrthographic).pieces, count + 1);
}

}  // namespace
}  // namespace curvisplat
