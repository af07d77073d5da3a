#include "render/project/splat_pieces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <numbers>
#include <random>
#include <vector>

#include "render/colour/transfer_function.h"
#include "render/project/projection.h"
#include "stream/model/border_code.h"
#include "stream/model/kernel.h"
#include "tests/reference/splat_compositor.h"

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

/// The kernel of Crawfis and Max (1993), along two axes, at x spacings from the middle.
double marginal(double x) {
  constexpr int kSamples = 200;
  double sum = 0;
  for (int n = 0; n < kSamples; ++n) {
    const double across = kKernelSupport * (n + 0.5) / kSamples, r = std::hypot(x, across);
    const double left = std::max(0.0, 1.556228 - r);
    sum += across * (r < 0.889392 ? 0.557526 + r * r * (-1.157743 + 0.671033 * r)
                                  : left * left * (0.067599 + 0.282474 * left));
  }
  return 2 * std::numbers::pi * sum * kKernelSupport / kSamples;
}

/// The largest error of the density of a uniform medium of whole cells that grow by e^growth from a face inwards, along a line of
/// them: drawn in the given style.
double worstBehindFace(const BorderStyle& style, double growth) {
  const glm::dvec3 along(0, 0, 1);
  const uint32_t code = packBorderCode({&along, 1}, 1);
  double worst = 0;
  for (double x = 0.005; x < 2.5; x += 0.01) {
    double density = 0, start = 0;
    for (int cell = 0; cell < 8; ++cell) {
      const double length = std::exp(growth * cell);
      SplatPiece whole{{0, 0, static_cast<float>(start + 0.5 * length)},
                       {1, 1, static_cast<float>(length), 0, 0, 0},
                       {},
                       0,
                       static_cast<float>(length)};
      whole.growth.count = 1;
      whole.growth.unit[0] = glm::vec3(along);
      whole.growth.growth[0] = static_cast<float>(growth);
      BorderPieces pieces;
      size_t count = 1;
      if (cell == 0) {
        count = partsAtBorder(whole, code, style, pieces);
      } else {
        pieces[0] = whole;
        pieces[0].position.z += static_cast<float>(0.14 * growth * length);  // the drift
      }
      for (size_t n = 0; n < count; ++n) {
        const SplatPiece& piece = pieces[n];
        const double size = static_cast<double>(piece.shape.axis2),
                     u = (x - static_cast<double>(piece.position.z)) / size;
        const double v = u / kKernelSigma;
        const double skew = 0.9 * static_cast<double>(piece.growth.growth[0]) * (v * v * v - 3 * v) / 6;
        if (std::abs(u) < kKernelSupport)
          density += static_cast<double>(piece.weight) / size * marginal(u) * std::max(0.0, 1 + skew);
      }
      start += length;
    }
    worst = std::max(worst, std::abs(density - 1));
  }
  return worst;
}

TEST(BorderParts, InPairsLeaveNoBandsBehindAFace) {
  for (const double growth : {-0.25, -0.145, 0.0, 0.1, 0.25}) {
    EXPECT_LT(worstBehindFace(kWholeCellPairs, growth), growth == 0 ? 0.003 : 0.01) << growth;
    EXPECT_GT(worstBehindFace(kWholeCellStyle, growth), 0.05) << growth;
  }
}

TEST(BorderParts, InPairsAreCutAtTheFaceBoth) {
  const glm::dmat3 a = factorOf(kWhole.shape);
  for (size_t axes = 1; axes <= 3; ++axes) {
    const uint32_t code = packBorderCode({kInward, axes}, (1u << axes) - 1);
    const InwardAxes inward = inwardAxes(code);
    BorderPieces pieces;
    ASSERT_EQ(partsAtBorder(kWhole, code, kWholeCellPairs, pieces), size_t{1} << axes);
    for (size_t n = 0; n < size_t{1} << axes; ++n) {
      const SplatPiece& piece = pieces[n];
      EXPECT_NEAR(piece.weight, kWhole.weight, 1e-6);  // a cell beyond the face is as large
      const glm::dmat3 to_frame = glm::inverse(factorOf(piece.shape));
      ASSERT_EQ(piece.faces.count, static_cast<int>(axes));
      for (size_t axis = 0; axis < axes; ++axis) {
        const CutFace& face = piece.faces.face[axis];
        const glm::dvec3 on_face = glm::dvec3(kWhole.position) - a * (0.5 * glm::dvec3(inward.axis[axis]));
        EXPECT_NEAR(glm::dot(glm::dvec3(face.inward), to_frame * (on_face - glm::dvec3(piece.position))),
                    -face.distance, 1e-4);
        EXPECT_NEAR(face.distance, (n >> axis & 1) != 0 ? 0.5 : -0.5, 1e-4);
      }
    }
  }
  // Merged splats stay one.
  BorderPieces pieces;
  EXPECT_EQ(partsAtBorder(kWhole, packMergedCode(kInward[0], 0.5, 1), kWholeCellPairs, pieces), 1u);
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

TEST(BorderParts, OfAPlateAreOneAsThinAsIt) {
  const glm::vec3 q(inwardAxes(packPlateCode(kInward[0])).axis[0]);
  EXPECT_LT(glm::distance(glm::dvec3(q), kInward[0]), 0.02);
  BorderPieces pieces;
  ASSERT_EQ(partsAtBorder(kWhole, packPlateCode(kInward[0]), kHalfCellStyle, pieces), 1u);
  const SplatPiece& piece = pieces[0];
  EXPECT_EQ(piece.position, kWhole.position);
  EXPECT_EQ(piece.weight, kWhole.weight);
  EXPECT_EQ(piece.mean, kWhole.mean);
  EXPECT_EQ(piece.faces.count, 0);
  // The kernel's deviation across it is that of the plate; the gradient stays, and so do the extents at right angles in its frame.
  const glm::dmat3 drawn = factorOf(piece.shape), whole = factorOf(kWhole.shape);
  const glm::dvec3 normal = glm::normalize(glm::inverse(glm::transpose(whole)) * glm::dvec3(q));
  const double length = glm::length(normal * whole);
  EXPECT_NEAR(glm::length(normal * drawn) * kKernelSigma, length / std::sqrt(12.0), 1e-4 * length);
  const glm::dvec3 in_plane = glm::normalize(glm::cross(glm::dvec3(q), glm::dvec3(0, 0, 1)));
  EXPECT_NEAR(glm::length((glm::inverse(glm::transpose(whole)) * in_plane) * drawn), 1, 1e-4);
  const auto gradient = [](const glm::dmat3& factor, const Slope& w) {
    return glm::inverse(glm::transpose(factor)) * vectorOf(w);
  };
  const glm::dvec3 expected = gradient(whole, kWhole.slope);
  EXPECT_LT(glm::distance(gradient(drawn, piece.slope), expected), 1e-3 * glm::length(expected));
}

TEST(BorderParts, AreCutAtTheFacesThatTheyLieBehind) {
  const glm::dmat3 a = factorOf(kWhole.shape);
  for (size_t ends = 0; ends <= 2; ++ends) {
    const uint32_t code = packLayersCode({kInward, 3}, ends);
    const InwardAxes inward = inwardAxes(code);
    for (const float growth : {0.0f, 0.5f}) {
      SplatPiece whole = kWhole;
      if (growth != 0) {
        whole.growth.count = 1;
        whole.growth.unit[0] = -inward.axis[2];
        whole.growth.growth[0] = -growth;
      }
      BorderPieces pieces;
      ASSERT_EQ(partsAtBorder(whole, code, kHalfCellStyle, pieces), 1u);
      const SplatPiece& piece = pieces[0];
      ASSERT_EQ(piece.faces.count, 3);
      const glm::dmat3 to_frame = glm::inverse(factorOf(piece.shape));
      for (size_t n = 0; n < 3; ++n) {
        const CutFace& face = piece.faces.face[n];
        const bool is_layer = n >= ends;
        EXPECT_EQ(face.edge_on, is_layer);
        const double distance = !is_layer ? 0.5 : n == 2 ? layerDistance(growth) : 1;
        const glm::dvec3 q(inward.axis[n]), other(inward.axis[(n + 1) % 3]);
        for (const double away : {-1.0, 0.0, 2.0}) {
          const glm::dvec3 on_face = glm::dvec3(kWhole.position) + a * (-distance * q + away * other);
          const glm::dvec3 u = to_frame * (on_face - glm::dvec3(piece.position));
          EXPECT_NEAR(glm::dot(glm::dvec3(face.inward), u), -face.distance, 1e-4);
        }
      }
      if (ends > 0) continue;
      EXPECT_EQ(piece.position, kWhole.position);
      EXPECT_EQ(factorOf(piece.shape), factorOf(kWhole.shape));
      EXPECT_EQ(piece.weight, kWhole.weight);
    }
  }
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
struct PiecedBrick {
  SplatGeometry geometry;
  SplatVariable variable;

  PiecedBrick(size_t count, uint32_t border_code) {
    geometry.resize(count);
    variable.resize(count);
    Splat splat;
    splat.axis = {0.1, 0.1, 0.1};
    splat.weight = 1e-3;
    for (size_t n = 0; n < count; ++n)
      setSplat({geometry, variable}, n, {0.5, 0.5, 0.5}, splat, {0.5, {0.1, 0, 0}, 0}, {border_code});
  }
};

ProjectionCounts project(const PiecedBrick& brick, Projection projection,
                         const BorderStyle& borders = kHalfCellStyle) {
  Camera camera;
  camera.position = {0.5, 0.5, 4};
  camera.focal_point = {0.5, 0.5, 0};
  camera.projection = projection;
  ProjectionSettings settings;
  settings.view = ScreenView::of(camera, {64, 64}, glm::dvec3(1), kLowPass, 0.01);
  settings.borders = borders;
  const auto table = ClassificationTable::of(TransferFunction::preset("grey", 0, 1, 1), 0, 1);
  BrickProjector projector;
  projector.project(settings, table, glm::dvec3(0), brick.geometry, brick.variable);
  return projector.counts();
}

TEST(BorderParts, AreWhatHalfCellsAreDrawnAs) {
  const uint32_t corner = packBorderCode({kInward, 3});
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    const ProjectionCounts one = project(PiecedBrick(1, packBorderCode({kInward, 1})), projection);
    EXPECT_EQ(one.drawn, 1u);
    EXPECT_EQ(one.pieces, 2u);
    EXPECT_EQ(project(PiecedBrick(10, corner), projection).pieces, 80u);
    EXPECT_EQ(project(PiecedBrick(10, kNoBorder), projection).pieces, 10u);
  }
}

TEST(BorderParts, AtAFaceAreASplatAndItsCut) {
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    const ProjectionCounts one = project(PiecedBrick(7, packBorderCode({kInward, 2}, 3)), projection);
    EXPECT_EQ(one.drawn, 7u);
    EXPECT_EQ(one.pieces, 14u);
  }
}

TEST(BorderParts, AreNotDrawnWhereABrickHasTooMany) {
  const uint32_t corner = packBorderCode({kInward, 3});
  const size_t count = BrickProjector::kMaxPieces / 8;
  EXPECT_EQ(project(PiecedBrick(count, corner), Projection::kOrthographic).pieces, 8 * count);
  EXPECT_EQ(project(PiecedBrick(count + 1, corner), Projection::kOrthographic).pieces, count + 1);
}

TEST(BorderParts, AreOneInsteadOfAPairWhereABrickHasTooMany) {
  const uint32_t face = packBorderCode({kInward, 1}, 1);
  // A pair is two cut splats, and room is kept for the whole that the first of them replaces.
  const size_t count = BrickProjector::kMaxPieces / 3;
  EXPECT_EQ(project(PiecedBrick(count, face), Projection::kOrthographic, kWholeCellPairs).pieces, 4 * count);
  EXPECT_EQ(project(PiecedBrick(count + 1, face), Projection::kOrthographic, kWholeCellPairs).pieces,
            2 * (count + 1));
  EXPECT_EQ(project(PiecedBrick(count + 1, face), Projection::kOrthographic, kWholeCellStyle).pieces,
            2 * (count + 1));
}

}  // namespace
}  // namespace curvisplat
