// Growth codes that are found several at once have the same bits as one after the other, in every instruction set.
#include "preprocess/splats/inner_growth.h"

#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <random>

#include "preprocess/splats/node_splats.h"
#include "stream/model/growth_frames.h"

namespace curvisplat {
namespace {

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

/// Of several axes, one or none; beyond what codes hold; between two steps.
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
