// Moments of four cells at once are those of each cell, bit for bit. Which outer faces at a point splats end
// at; and the splats of points at which nodes hang.
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "preprocess/gather/outer_planes.h"
#include "preprocess/moments/cell_moments.h"
#include "preprocess/moments/mesh_splats.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

struct CellExample {
  CellKind kind;
  std::vector<glm::dvec3> corners;
};

const std::vector<CellExample>& shapes() {
  static const std::vector<CellExample> all{
      {CellKind::kPyramid, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}}},
      {CellKind::kWedge, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}},
      {CellKind::kHexahedron,
       {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}}};
  return all;
}

/// Four distorted cells of a shape, with values.
class FourCells {
 public:
  FourCells(const CellExample& shape, size_t fields, std::mt19937& random)
      : kind_(shape.kind), fields_(fields) {
    std::uniform_real_distribution<double> shift(-0.15, 0.15), value(-1, 1);
    for (size_t cell = 0; cell < kCellsAtOnce; ++cell) {
      const double size = std::exp(8 * value(random));
      const glm::dvec3 place(size * value(random), 100 * value(random), 1e-3 * value(random));
      for (const glm::dvec3& corner : shape.corners) {
        at_.push_back(place + size * (corner + glm::dvec3(shift(random), shift(random), shift(random))));
        for (size_t n = 0; n < fields; ++n) values_.push_back(static_cast<float>(1e3 * value(random)));
      }
    }
  }
  size_t corners() const { return at_.size() / kCellsAtOnce; }
  glm::dvec3& corner(size_t cell, size_t n) { return at_[cell * corners() + n]; }
  CellView view(size_t cell) const {
    return {kind_,
            std::span(at_).subspan(cell * corners(), corners()),
            std::span(values_).subspan(cell * corners() * fields_, corners() * fields_),
            {}};
  }
  std::array<CellView, kCellsAtOnce> views() const { return {view(0), view(1), view(2), view(3)}; }
  std::vector<double> oneByOne() const {
    const size_t size = corners() * momentCount(fields_);
    std::vector<double> moments(kCellsAtOnce * size);
    DualScratch scratch;
    for (size_t cell = 0; cell < kCellsAtOnce; ++cell)
      dualMoments(view(cell), fields_, scratch, std::span(moments).subspan(cell * size, size));
    return moments;
  }

 private:
  CellKind kind_;
  size_t fields_;
  std::vector<glm::dvec3> at_;
  std::vector<float> values_;
};

TEST(FourCells, HaveTheMomentsOfEachBitForBit) {
  std::mt19937 random(5);
  for (const CellExample& shape : shapes()) {
    for (size_t fields = 0; fields <= 4; ++fields) {
      ASSERT_TRUE(isTakenAtOnce(shape.kind, fields));
      for (int n = 0; n < 200; ++n) {
        const FourCells cells(shape, fields, random);
        const std::vector<double> expected = cells.oneByOne();
        std::vector<double> found(expected.size(), -1);
        ASSERT_TRUE(dualMomentsOfFour(cells.views(), fields, found));
        ASSERT_EQ(std::memcmp(found.data(), expected.data(), found.size() * sizeof(double)), 0)
            << shape.corners.size() << " corners, " << fields << " fields";
      }
    }
  }
}

TEST(FourCells, HaveTheBodyOfEachBitForBit) {
  std::mt19937 random(7);
  for (const CellExample& shape : shapes()) {
    for (int n = 0; n < 200; ++n) {
      FourCells cells(shape, 0, random);
      if (n % 10 == 0)  // a point: no volume
        for (size_t corner = 1; corner < cells.corners(); ++corner)
          cells.corner(2, corner) = cells.corner(2, 0);
      std::array<CellBody, kCellsAtOnce> found;
      setBodiesOfFour(cells.views(), found);
      for (size_t cell = 0; cell < kCellsAtOnce; ++cell) {
        const CellBody expected = bodyOf(cells.view(cell));
        ASSERT_EQ(std::memcmp(&found[cell], &expected, sizeof expected), 0)
            << shape.corners.size() << " corners";
      }
    }
  }
}

TEST(FourCells, WithAPieceWithoutVolumeAreLeftToOthers) {
  std::mt19937 random(6);
  for (const CellExample& shape : shapes())
    for (size_t cell = 0; cell < kCellsAtOnce; ++cell) {
      FourCells cells(shape, 1, random);
      for (size_t n = 0; n < cells.corners(); ++n) cells.corner(cell, n).z = 0;
      std::vector<double> found(cells.oneByOne().size());
      EXPECT_FALSE(dualMomentsOfFour(cells.views(), 1, found));
    }
}

TEST(FourCells, AreNotTakenOfOtherShapesOrWithManyFields) {
  for (const CellKind kind : {CellKind::kNone, CellKind::kTetrahedron, CellKind::kPolyhedron})
    EXPECT_FALSE(isTakenAtOnce(kind, 1));
  EXPECT_FALSE(isTakenAtOnce(CellKind::kHexahedron, 5));
}

constexpr uint64_t kPoint = 3;

/// How many of the faces at a point splats end at.
size_t keptOf(const std::vector<OuterPlane>& faces) {
  const TemporaryFolder folder;
  OuterPlanes planes(1, 8, 1 << 20, folder.path());
  uint64_t face = 0;
  for (const OuterPlane& plane : faces) planes.add(kPoint, plane, face++);
  planes.close();
  planes.leaveOutClosed(Progress());
  std::vector<OuterPlane> scratch;
  const OuterPlanes::OfRange kept = planes.load(0);
  const size_t count = kept.of(kPoint, scratch).size();
  const bool any_touching =
      std::any_of(faces.begin(), faces.end(), [](const OuterPlane& plane) { return plane.touches; });
  EXPECT_EQ(kept.isAtClosed(kPoint), any_touching && count < faces.size());
  EXPECT_FALSE(kept.isAtClosed(kPoint + 1));
  return count;
}

/// The unit squares on both sides of a wedge, at a point of its edge.
std::vector<OuterPlane> wedge(double degrees) {
  const double sine = std::sin(glm::radians(degrees)), cosine = std::cos(glm::radians(degrees));
  return {{0.25 * glm::dvec3(0, 0, 1), {0.5, 0.5, 0}},
          {0.25 * glm::dvec3(sine, 0, -cosine), {0.5 * cosine, 0.5, 0.5 * sine}}};
}

TEST(OuterPlanes, OfASharpEdgeAreKept) {
  for (const double degrees : {90.0, 25.0, 15.0, 8.0}) EXPECT_EQ(keptOf(wedge(degrees)), 2u) << degrees;
}

TEST(OuterPlanes, AgainstEachOtherAreLeftOut) {
  // A unit square, one of four that lie against it, and a face at right angles.
  const OuterPlane coarse{0.25 * glm::dvec3(0, 0, 1), {0.5, 0.5, 0}};
  const OuterPlane fine{0.0625 * glm::dvec3(0, 0, -1), {0.25, 0.25, 0}};
  const OuterPlane across{0.25 * glm::dvec3(1, 0, 0), {0, 0.5, 0.5}};
  EXPECT_EQ(keptOf({coarse, fine, across}), 1u);
  OuterPlane beside = fine;
  beside.touches = false;
  EXPECT_EQ(keptOf({coarse, beside}), 2u);
}

TEST(OuterPlanes, WhereVeryManyMeetAreLeftOut) {
  // All pairs of these would be 2 x 10^10.
  EXPECT_EQ(keptOf(std::vector<OuterPlane>(200'000, wedge(90)[0])), 0u);
}

TEST(OuterPlanes, AreNotComparedAfterAStop) {
  const TemporaryFolder folder;
  OuterPlanes planes(1, 8, 1 << 20, folder.path());
  planes.add(kPoint, wedge(90)[0]);
  planes.close();
  Progress progress;
  progress.stop(2);
  EXPECT_THROW(planes.leaveOutClosed(progress), Interrupted);
}

TEST(HangingNodes, KeepTheirLengthsAcrossOuterFaces) {
  // Beside a face at z = 0, and across one at x = 1 that does not fit: the splat of a fine cell's quarter. The scalar is linear.
  const glm::dvec3 gradient(3, -2, 5), point(1, 0.5, 0);
  constexpr double kFine = 0.125;
  const auto before = [&] {
    NodeSplat splat;
    splat.node_position = point;
    splat.splat = {point + 0.25 * kFine * glm::dvec3(1, 0, 1),
                   {0.5 * kFine, kFine, 0.5 * kFine},
                   {},
                   0.25 * kFine * kFine * kFine};
    return splat;
  };
  NodeSplat splat = before();
  const auto scalarAt = [&](const NodeSplat& of) { return glm::dot(gradient, of.splat.position); };
  std::array<SplatScalar, 1> values{{{scalarAt(splat), gradient * splat.splat.factor(), 0}}};
  const std::array<OuterPlane, 1> outer{{{glm::dvec3(0, 0, 0.1), point}}};
  fitAtHangingNode(outer, splat, values);
  EXPECT_DOUBLE_EQ(splat.splat.weight, before().splat.weight);
  EXPECT_NEAR(splat.splat.position.z, before().splat.position.z, 1e-12);
  EXPECT_NEAR(splat.splat.axis[2], 0.5 * kFine, 1e-12);
  // Nearer to the face, and about as thick as a whole cell.
  EXPECT_GT(splat.splat.position.x, 1);
  EXPECT_LT(splat.splat.position.x, 1 + 0.2 * kFine);
  EXPECT_GT(splat.splat.axis[0], 0.75 * kFine);
  EXPECT_LT(splat.splat.axis[0], 1.1 * kFine);
  // The scalar is what it was.
  EXPECT_NEAR(values[0].mean, scalarAt(splat), 1e-12);
  EXPECT_LT(glm::distance(values[0].slope, gradient * splat.splat.factor()), 1e-12);

  NodeSplat flat = before();
  flat.splat.weight = 0;
  fitAtHangingNode(outer, flat, values);
  EXPECT_EQ(flat.splat.position, before().splat.position);
  EXPECT_EQ(flat.splat.axis, before().splat.axis);
}

}  // namespace
}  // namespace curvisplat
