// Nodes and growth codes that are computed several at once have the same bits as one after the other, in
// every instruction set.
#include <gtest/gtest.h>
#include <hwy/highway.h>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "preprocess/splats/inner_nodes.h"
#include "preprocess/splats/node_splats.h"
#include "stream/model/growth_code.h"
#include "tests/reference/mapped_block.h"

namespace curvisplat {
namespace {

bool sameBits(double a, double b) {
  return std::bit_cast<uint64_t>(a) == std::bit_cast<uint64_t>(b);
}
bool sameBits(const glm::dvec3& a, const glm::dvec3& b) {
  return sameBits(a.x, b.x) && sameBits(a.y, b.y) && sameBits(a.z, b.z);
}

bool sameSplats(const NodeSplats& a, const NodeSplats& b) {
  if (a.splats.size() != b.splats.size() || a.values.size() != b.values.size()) return false;
  bool same =
      a.degenerate == b.degenerate && a.right_handed == b.right_handed && a.left_handed == b.left_handed;
  for (size_t n = 0; n < a.splats.size(); ++n) {
    const NodeSplat &s = a.splats[n], &t = b.splats[n];
    same &= s.node == t.node && s.regular == t.regular && s.border_code == t.border_code &&
            s.growth_code == t.growth_code && s.isForSeams() == t.isForSeams() &&
            sameBits(s.node_position, t.node_position) && sameBits(s.spacing, t.spacing) &&
            sameBits(s.splat.position, t.splat.position) && sameBits(s.splat.weight, t.splat.weight);
    for (size_t axis = 0; axis < 3; ++axis)
      same &= sameBits(s.splat.axis[axis], t.splat.axis[axis]) &&
              sameBits(s.splat.shear[axis], t.splat.shear[axis]);
  }
  for (size_t n = 0; n < a.values.size(); ++n)
    same &= sameBits(a.values[n].mean, b.values[n].mean) && sameBits(a.values[n].slope, b.values[n].slope) &&
            sameBits(a.values[n].variance, b.values[n].variance);
  return same;
}

NodeSplats splatsOf(const BlockWindow& window) {
  NodeScratch scratch;
  NodeSplats splats;
  computeNodeSplats(window, window.window, scratch, splats);
  return splats;
}

/// Computes all nodes one by one, as where the splat of a node may be a part.
NodeSplats oneByOne(BlockWindow window) {
  const std::vector<uint64_t> covered(window.nodes->x.size());
  window.covered = covered.data();
  return splatsOf(window);
}

MappedBlock jitteredBlock(uint64_t ni, double handedness, double jitter) {
  std::mt19937_64 random(ni);
  std::normal_distribution<double> normal(0, 1);
  MappedBlock grid(ni, 7, 8, [&](double i, double j, double k) {
    const glm::dvec3 even(i * (1 + 0.05 * i) + 0.3 * std::sin(j), std::exp(0.4 * j),
                          handedness * k + 0.1 * i * j);
    return even + jitter * glm::dvec3(normal(random), normal(random), normal(random));
  });
  grid.addScalar([](const glm::dvec3& p) { return std::sin(p.x) * p.y + p.z; });
  grid.addScalar([](const glm::dvec3& p) { return p.x < 6 ? 0.0 : p.y < 3 ? -0.0 : 1.0; });
  return grid;
}

TEST(InnerNodes, HaveTheBitsOfOneAfterTheOther) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    for (const uint64_t ni : {4u, 11u, 12u, 13u, 19u, 20u, 21u, 40u}) {
      for (const double handedness : {1.0, -1.0}) {
        const MappedBlock grid = jitteredBlock(ni, handedness, 0.05);
        EXPECT_TRUE(sameSplats(splatsOf(grid.window()), oneByOne(grid.window())))
            << hwy::TargetName(target) << ", " << ni << " nodes";
      }
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

TEST(InnerNodes, ThatHaveCollapsedAreComputedOneByOne) {
  // Some are flat, in the rest of a row too; some coincide with all their neighbours.
  MappedBlock grid = jitteredBlock(27, 1, 0);
  for (const uint64_t i : {5u, 9u, 20u, 23u}) {
    for (const ptrdiff_t axis_stride : {ptrdiff_t{1}, ptrdiff_t{27}}) {
      const size_t at = grid.at(i, 3, 4);
      for (const ptrdiff_t step : {-axis_stride, axis_stride}) {
        const size_t beside = at + static_cast<size_t>(step);
        grid.nodes.x[beside] = grid.nodes.x[at];
        grid.nodes.y[beside] = grid.nodes.y[at];
        grid.nodes.z[beside] = grid.nodes.z[at];
      }
    }
  }
  const NodeSplats together = splatsOf(grid.window());
  EXPECT_GE(std::count_if(together.splats.begin(), together.splats.end(),
                          [](const NodeSplat& node) { return !node.regular; }),
            4);
  EXPECT_TRUE(sameSplats(together, oneByOne(grid.window())));
}

TEST(InnerNodes, OfPartsOfRowsAndBesideBlanksAreTheSame) {
  MappedBlock grid = jitteredBlock(61, 1, 0.02);
  grid.nodes.blank[grid.at(30, 2, 3)] = 1;
  for (const auto& [i0, i1] : {std::pair<uint64_t, uint64_t>{0, 30}, {1, 61}, {2, 10}, {17, 26}, {44, 60}}) {
    BlockWindow window = grid.window();
    window.i0 = i0;
    window.i1 = i1;
    EXPECT_TRUE(sameSplats(splatsOf(window), oneByOne(window))) << i0;
  }
}

TEST(InnerNodes, BetweenBlanksAreTheSame) {
  std::mt19937_64 random(5);
  for (const uint64_t blanks : {1u, 3u, 20u, 200u}) {
    MappedBlock grid = jitteredBlock(90, 1, 0.02);
    for (uint64_t n = 0; n < blanks; ++n) grid.nodes.blank[random() % grid.nodes.blank.size()] = 1;
    EXPECT_TRUE(sameSplats(splatsOf(grid.window()), oneByOne(grid.window()))) << blanks << " blanks";
  }
}

TEST(InnerNodes, FarFromBlanksDoNotKnowOfThem) {
  constexpr uint64_t kNi = 60, kBlank = 31, kReach = kStretchReach + 1;
  MappedBlock grid = jitteredBlock(kNi, 1, 0.02);
  const NodeSplats without = splatsOf(grid.window());
  for (uint64_t k = 0; k < 8; ++k)
    for (uint64_t j = 0; j < 7; ++j) grid.nodes.blank[grid.at(kBlank, j, k)] = 1;
  const NodeSplats with = splatsOf(grid.window());
  const auto farOnes = [&](const NodeSplats& all) {
    NodeSplats some;
    const size_t variables = all.values.size() / all.splats.size();
    for (size_t n = 0; n < all.splats.size(); ++n) {
      const uint64_t i = all.splats[n].node % kNi;
      if (i + kReach > kBlank && i < kBlank + kReach) continue;
      some.splats.push_back(all.splats[n]);
      const auto values = all.values.begin() + static_cast<ptrdiff_t>(n * variables);
      some.values.insert(some.values.end(), values, values + static_cast<ptrdiff_t>(variables));
    }
    return some;
  };
  EXPECT_GT(farOnes(with).splats.size(), 2000u);
  EXPECT_TRUE(sameSplats(farOnes(with), farOnes(without)));
}

/// Lattices' axes as cells have them: at right angles, of either handedness, anywhere or nearly along the frame's.
glm::dmat3 randomAxes(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double spread = random() % 3 == 0 ? 1e-3 : 1;
  glm::dmat3 turn = glm::mat3_cast(glm::normalize(glm::dquat(
      1 + normal(random), spread * normal(random), spread * normal(random), spread * normal(random))));
  if (random() % 8 == 0) turn = glm::dmat3(0, 1, 0, 0, 0, 1, 1, 0, 0);
  if (random() % 2 == 0) turn[random() % 3] *= -1;
  return turn;
}

/// Growth along several axes, one or none; beyond what codes hold; between two steps.
std::array<float, 3> randomGrowth(std::mt19937& random) {
  std::uniform_real_distribution<float> length(-0.8f, 0.8f);
  std::array<float, 3> growth{};
  for (float& g : growth)
    if (random() % 2 == 0)
      g = random() % 4 == 0 ? static_cast<float>(random() % 9) / 64 - 1.0f / 16 : length(random);
  return growth;
}

TEST(InnerGrowth, HasTheBitsOfOneAfterTheOther) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    std::mt19937 random(7);
    size_t along_several = 0;
    for (int round = 0; round < 2000; ++round) {
      InnerSplats splats;
      float growth[3][kInnerNodesAtOnce];
      std::array<glm::dmat3, kInnerNodesAtOnce> axes;
      for (size_t n = 0; n < kInnerNodesAtOnce; ++n) {
        axes[n] = randomAxes(random);
        const std::array<float, 3> g = randomGrowth(random);
        for (int axis = 0; axis < 3; ++axis) {
          growth[axis][n] = g[static_cast<size_t>(axis)];
          for (int c = 0; c < 3; ++c) splats.rotated[axis][c][n] = axes[n][axis][c];
        }
      }
      InnerGrowthCodes codes;
      findInnerGrowth(splats, {growth[0], growth[1], growth[2]}, codes);
      for (size_t n = 0; n < kInnerNodesAtOnce; ++n) {
        const uint32_t expected = growthCode({growth[0][n], growth[1][n], growth[2][n]},
                                             [&](const glm::dvec3& v) { return axes[n] * v; });
        size_t grows = 0;
        for (size_t axis = 0; axis < 3; ++axis) grows += growthOf(expected, axis) != 0;
        along_several += grows > 1;
        if (grows > 1)
          EXPECT_EQ(codes.of[n], kGrowsAlongSeveral);
        else
          EXPECT_EQ(static_cast<uint32_t>(codes.of[n]), expected) << hwy::TargetName(target) << ", " << round;
      }
    }
    EXPECT_GT(along_several, 0u);
    EXPECT_LT(along_several, 12000u);
    hwy::SetSupportedTargetsForTest(0);
  }
}

}  // namespace
}  // namespace curvisplat
