#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "preprocess/seams/joint_nodes.h"
#include "preprocess/shape/shape.h"
#include "preprocess/splats/stretch.h"
#include "stream/model/border_code.h"
#include "tests/preprocess/merged_seams.h"

namespace curvisplat {
namespace {

constexpr double kStepsPerOctave = 24;  // of a logarithm to the base of 2

/// The length as it is kept.
double kept(double length, double unit) {
  const double steps = std::clamp(std::round(kStepsPerOctave * std::log2(length / unit)), -127.0, 127.0);
  return unit * std::exp2(steps / kStepsPerOctave);
}

void expectKept(const CellRow& row, float unit) {
  SquaredExtents extents;
  for (size_t n = 0; n < row.size(); ++n) extents[n] = 4 * row[n] * row[n];
  const JointLine of_row(row, unit), of_extents = JointLine::ofExtents(extents, unit);
  ASSERT_TRUE(of_row.isThere());
  ASSERT_TRUE(of_extents.isThere());
  for (size_t n = 0; n < row.size(); ++n) {
    ASSERT_NEAR(of_row.row()[n] / kept(row[n], unit), 1, 1e-12) << row[n] << " " << unit;
    ASSERT_NEAR(of_extents.row()[n] / kept(std::sqrt(extents[n]) / 2, unit), 1, 1e-12)
        << row[n] << " " << unit;
  }
}

TEST(JointLine, RoundsLogarithmsAsTheExactOnesAre) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> exponent(-6, 6);
  for (int n = 0; n < 20000; ++n) {
    const auto unit = static_cast<float>(std::exp2(exponent(random)));
    CellRow row;
    for (double& length : row) length = unit * std::exp2(exponent(random));
    expectKept(row, unit);
  }
}

TEST(JointLine, RoundsBesideTheMiddleBetweenTwoSteps) {
  for (int steps = -130; steps <= 130; ++steps)
    for (const double beside : {-1e-3, -1e-6, -1e-9, 1e-9, 1e-6, 1e-3}) {
      CellRow row;
      row.fill(3 * std::exp2((steps + 0.5 + beside) / kStepsPerOctave));
      expectKept(row, 3);
    }
}

TEST(JointLine, KeepsLengthsOfAnySize) {
  for (const double length : {1e-300, 1e-160, 1e-40, 1e-12, 1.0, 1e12, 1e40, 1e150}) {
    CellRow row;
    row.fill(length);
    SquaredExtents extents;
    extents.fill(length);
    const double kept_length = JointLine(row, 1).row()[2],
                 kept_extent = JointLine::ofExtents(extents, 1).row()[2];
    EXPECT_NEAR(kept_length, kept(length, 1), 1e-12 * kept_length);
    EXPECT_NEAR(kept_extent, kept(std::sqrt(length) / 2, 1), 1e-12 * kept_extent);
  }
  EXPECT_FALSE(JointLine({1, 1, 0, 1, 1}, 1).isThere());
  EXPECT_FALSE(JointLine({1, 1, 1, 1, 1}, 0).isThere());
  EXPECT_FALSE(JointLine::ofExtents({1, 1, 1, NAN, 1}, 1).isThere());
  EXPECT_FALSE(JointLine::ofExtents({1, 1, 1, 1, INFINITY}, 1).isThere());
}

class Joints : public MergedSeams {};

/// Cells that grow along i, by `growth` from one to the next.
MappedBlock growingBlock(uint64_t first, uint64_t count, double growth, uint64_t first_node) {
  MappedBlock block(count, 5, 6, [&](double i, double j, double k) {
    return glm::dvec3((std::pow(growth, i + static_cast<double>(first)) - 1) / (growth - 1), j, k);
  });
  block.addScalar(field);
  block.first_node = first_node;
  return block;
}

TEST_F(Joints, OfGrowingCellsAreSkewedAsTheCellsBesideThem) {
  for (const double growth : {1.2, 0.85}) {
    const MappedBlock uncut = growingBlock(0, 13, growth, 0);
    std::vector<Piece> faces = facesOf(growingBlock(0, 7, growth, 0));
    const std::vector<Piece> others = facesOf(growingBlock(6, 7, growth, 210));
    faces.insert(faces.end(), others.begin(), others.end());
    const std::vector<Piece> joined = merge(faces);
    const NodeSplats whole = uncut.splats();
    const auto expected = std::find_if(whole.splats.begin(), whole.splats.end(),
                                       [&](const NodeSplat& n) { return n.node == uncut.at(6, 2, 2); });
    ASSERT_NE(expected, whole.splats.end());
    const std::vector<Piece> there = piecesAt(joined, expected->node_position);
    ASSERT_EQ(there.size(), 1u);
    const Splat &found = there[0].node.splat, &exact = expected->splat;
    // The drift is 0.03 and 0.02 of a cell.
    EXPECT_LT(glm::distance(found.position, exact.position), 0.002 * exact.axis[0]) << growth;
    const float skew = cellGrowth(there[0].node.growth_code).growth[0];
    EXPECT_NEAR(skew, cellGrowth(expected->growth_code).growth[0], 0.032) << growth;
    EXPECT_NEAR(skew, std::log(growth), 0.03) << growth;
    const double mean = whole.values[static_cast<size_t>(expected - whole.splats.begin())].mean;
    EXPECT_NEAR(there[0].value.mean, mean, 0.002 * exact.axis[0]) << growth;
  }
}

TEST_F(Joints, OfEvenBlocksOfOtherSizesGrowByHalfOfTheJump) {
  std::vector<Piece> faces = facesOf(boxBlock({0, 0, 0}, {1, 1, 1}, 0));
  const std::vector<Piece> others = facesOf(boxBlock({3, 0, 0}, {1.25, 1, 1}, 64));
  faces.insert(faces.end(), others.begin(), others.end());
  const std::vector<Piece> there = piecesAt(merge(faces), {3, 1, 1});
  ASSERT_EQ(there.size(), 1u);
  EXPECT_NEAR(cellGrowth(there[0].node.growth_code).growth[0], 0.5 * std::log(1.25), 0.02);
}

/// Nodes [i0, i0+ni) x ... of a grid whose cells are of unlike sizes along all three axes, and sheared.
MappedBlock unevenBlock(std::array<uint64_t, 3> first, std::array<uint64_t, 3> count, uint64_t first_node,
                        double (*scalar)(const glm::dvec3&) = field) {
  static constexpr std::array<double, 6> kSizes{1, 1.6, 1, 1.5, 2.4, 1.5};  // elements of three cells
  const auto along = [](double n) {
    double at = 0;
    for (int cell = 0; cell < static_cast<int>(n); ++cell) at += kSizes[static_cast<size_t>(cell) % 6];
    return at;
  };
  MappedBlock block(count[0], count[1], count[2], [=](double i, double j, double k) {
    const glm::dvec3 c(along(i + static_cast<double>(first[0])), along(j + static_cast<double>(first[1])),
                       along(k + static_cast<double>(first[2])));
    return glm::dvec3(c.x + 0.25 * c.y, c.y - 0.5 * c.z, 0.5 * c.z);
  });
  block.addScalar(scalar);
  block.first_node = first_node;
  return block;
}

// Eight blocks whose cells are 1.5 times as large on one side of a joint as on the other, and the same nodes as one block.
TEST_F(Joints, LeaveCellsOfUnlikeSizesAsIfTheyHadNeverBeenCut) {
  std::vector<MappedBlock> blocks;
  for (int octant = 0; octant < 8; ++octant) {
    std::array<uint64_t, 3> first{};
    for (int axis = 0; axis < 3; ++axis) first[axis] = octant >> axis & 1 ? 6 : 0;
    blocks.push_back(unevenBlock(first, {7, 7, 7}, blocks.empty() ? 0 : blocks.back().first_node + 1000));
  }
  const Places cut = mergeBlocks(blocks);
  EXPECT_EQ(merged_, 8u * 7 * 7 * 7 - 13 * 13 * 13);
  const Places whole = mergeBlocks({unevenBlock({0, 0, 0}, {13, 13, 13}, 0)});
  const MappedBlock grid = unevenBlock({0, 0, 0}, {13, 13, 13}, 0);
  double worst_scalar = 0;
  for (const auto& [place, piece] : cut)
    worst_scalar = std::max(worst_scalar, std::abs(piece.value.mean - field(piece.node.splat.position)));
  EXPECT_LT(worst_scalar, 1e-5);  // values are floats
  for (const std::array<uint64_t, 3> at :
       {std::array<uint64_t, 3>{6, 6, 6}, {5, 6, 6}, {6, 7, 4}, {5, 7, 6}, {5, 5, 7}, {4, 6, 8}}) {
    const size_t n = grid.at(at[0], at[1], at[2]);
    const glm::dvec3 node(grid.nodes.x[n], grid.nodes.y[n], grid.nodes.z[n]);
    const Piece found = nearest(cut, node), expected = nearest(whole, node);
    const Splat &a = found.node.splat, &b = expected.node.splat;
    SCOPED_TRACE(testing::Message() << at[0] << ' ' << at[1] << ' ' << at[2]);
    EXPECT_LT(glm::length(inFrameOf(b, a.position - b.position)), 0.01);
    EXPECT_NEAR(a.weight, b.weight, 1e-9);
    const glm::dmat3 s = a.factor() * glm::transpose(a.factor()), t = b.factor() * glm::transpose(b.factor());
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r)
        EXPECT_NEAR(s[c][r], t[c][r], 0.03 * std::sqrt(t[c][c] * t[r][r])) << c << r;
    const glm::dvec3 gradient = gradientOf(a, found.value.slope);
    EXPECT_LT(glm::distance(gradient, glm::dvec3(1, -2, 0.5)), 1e-6);
    EXPECT_EQ(found.node.border_code, kNoBorder);
    // The third cumulants, as a vector of sums: of codes to a thirtieth.
    const auto skew = [](const NodeSplat& of) {
      const CellGrowth growth = cellGrowth(of.growth_code);
      glm::dvec3 sum(0.0);
      for (size_t axis = 0; axis < 3; ++axis)
        sum += static_cast<double>(growth.growth[axis]) *
               glm::normalize(of.splat.factor() * glm::dvec3(growth.axis[axis]));
      return sum;
    };
    EXPECT_LT(glm::distance(skew(found.node), skew(expected.node)), 0.1);
  }
}

TEST_F(Joints, LeaveBentScalarsAsIfTheyHadNeverBeenCut) {
  const auto bent = [](const glm::dvec3& p) { return 0.1 * p.x * p.x; };
  const auto block = [&](uint64_t first, uint64_t count, uint64_t node) {
    return unevenBlock({first, 0, 0}, {count, 7, 7}, node, bent);
  };
  const Places cut = mergeBlocks({block(0, 7, 0), block(6, 7, 1000)}), whole = mergeBlocks({block(0, 13, 0)});
  ASSERT_EQ(cut.size(), whole.size());
  for (const auto& [place, expected] : whole) {
    const Piece found = nearest(cut, expected.node.splat.position);
    // The means are up to 0.046 above the scalar at the middle: what the kernel makes of it.
    EXPECT_NEAR(found.value.mean, expected.value.mean, 0.01);
    EXPECT_NEAR(found.value.slope.x, expected.value.slope.x, 0.012 * std::abs(expected.value.slope.x) + 0.01);
    EXPECT_EQ(found.value.variance, 0);
  }
}

TEST_F(Joints, HalvesOfUnlikeThicknessStayApartAndEndAtTheFace) {
  for (const double ratio : {1.2, 2.8, 4.0}) {
    std::vector<Piece> faces = facesOf(boxBlock({0, 0, 0}, {1, 1, 1}, 0));
    const std::vector<Piece> others = facesOf(boxBlock({3, 0, 0}, {ratio, 1, 1}, 64));
    faces.insert(faces.end(), others.begin(), others.end());
    const glm::dvec3 on_joint(3, 1, 1);

    const std::vector<Piece> merged = merge(faces, 64 << 20, 8, UnlikeHalves::kMerged);
    EXPECT_EQ(piecesAt(merged, on_joint).size(), 1u);
    const std::vector<Piece> there = piecesAt(merge(faces), on_joint);
    if (ratio < kMaxJointRatio) {
      EXPECT_EQ(there.size(), 1u);
      continue;
    }
    EXPECT_EQ(merged_, 0u);
    ASSERT_EQ(there.size(), 2u);
    for (const Piece& piece : there) {
      const InwardAxes open = inwardAxes(piece.node.border_code);
      ASSERT_EQ(open.count, 1);
      EXPECT_TRUE(open.hasFace(0));
      EXPECT_NEAR(open.axis[0].x, piece.node.node < 64 ? -1 : 1, 0.01);
      EXPECT_NEAR(piece.node.splat.weight, piece.node.node < 64 ? 0.5 : 0.5 * ratio, 1e-12);
    }
  }
}

// Halves at the edges of the joint are fitted to where they are cut, others are not.
TEST_F(Joints, HalvesStayApartAtAllOfAJointOrNowhere) {
  for (int step = 0; step < 100; ++step) {
    const double last = 0.3 + 0.002 * step;
    MappedBlock shortened(
        6, 6, 6, [&](double i, double j, double k) { return glm::dvec3(i < 5 ? i : 4 + last, j, k); });
    MappedBlock even(6, 6, 6, [&](double i, double j, double k) { return glm::dvec3(4 + last + i, j, k); });
    for (MappedBlock* block : {&shortened, &even}) block->addScalar(field);
    even.first_node = 216;
    std::vector<Piece> faces = facesOf(shortened);
    const std::vector<Piece> others = facesOf(even);
    faces.insert(faces.end(), others.begin(), others.end());
    const std::vector<Piece> joined = merge(faces);
    const size_t inside = piecesAt(joined, {4 + last, 2, 2}).size();
    for (const auto& [j, k] : {std::pair<double, double>{0, 2}, {1, 2}, {0, 0}})
      EXPECT_EQ(piecesAt(joined, {4 + last, j, k}).size(), inside) << last;
  }
}

TEST_F(Joints, OfFourBlocksUnlikeAlongOneAxisMergeAlongTheOther) {
  std::vector<Piece> faces;
  for (int n = 0; n < 4; ++n) {
    const bool right = n % 2 != 0, upper = n / 2 != 0;
    const glm::dvec3 first(right ? 3 : 0, upper ? 3 : 0, 0), size(right ? 4 : 1, 1, 1);
    for (const Piece& face : facesOf(boxBlock(first, size, 64 * static_cast<uint64_t>(n))))
      faces.push_back(face);
  }
  std::shuffle(faces.begin(), faces.end(), std::mt19937(3));
  const std::vector<Piece> there = piecesAt(merge(faces), {3, 3, 1});
  ASSERT_EQ(there.size(), 2u);
  for (const Piece& piece : there) {
    const bool left = piece.node.node < 64;
    EXPECT_NEAR(piece.node.splat.weight, left ? 0.5 : 2, 1e-12);
    const InwardAxes open = inwardAxes(piece.node.border_code);
    ASSERT_EQ(open.count, 1);
    EXPECT_NEAR(open.axis[0].x, left ? -1 : 1, 0.01);
    EXPECT_TRUE(open.hasFace(0));
  }
}

}  // namespace
}  // namespace curvisplat
