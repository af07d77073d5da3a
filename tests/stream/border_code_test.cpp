#include "stream/model/border_code.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <random>
#include <vector>

#include "stream/model/kernel.h"
#include "stream/model/layers_code.h"

namespace curvisplat {
namespace {

/// How far from a direction the one that is kept may be. Three numbers of the quaternion are off by half a step at the most, and the
/// fourth, which is the largest, by all three of these: 2 sqrt(3 + 9) half steps.
const double kMaxTurn = 2 * std::sqrt(12.0) * 0.5 * std::sqrt(2.0) / 255;

/// Orthogonal, of either handedness.
glm::dmat3 randomAxes(std::mt19937& random) {
  std::normal_distribution<double> normal;
  glm::dquat turn;
  for (int n = 0; n < 4; ++n) turn[n] = normal(random);
  turn = glm::normalize(turn);
  glm::dmat3 axes = glm::mat3_cast(turn);
  if (random() & 1) axes[2] = -axes[2];
  return axes;
}

TEST(BorderCode, KeepsItsDirections) {
  double square_sum = 0;
  int directions = 0;
  std::mt19937 random(1);
  for (int n = 0; n < 3000; ++n) {
    const glm::dmat3 axes = randomAxes(random);
    const std::vector<glm::dvec3> inward(&axes[0], &axes[0] + 1 + n % 3);
    const uint32_t faces = random() % (1u << inward.size());
    const uint32_t code = packBorderCode(inward, faces);
    ASSERT_TRUE(isPossibleBorderCode(code));
    const InwardAxes kept = inwardAxes(code);
    EXPECT_EQ(kept.faces, faces);
    ASSERT_EQ(kept.count, static_cast<int>(inward.size()));
    for (size_t a = 0; a < inward.size(); ++a) {
      const double distance = glm::distance(glm::dvec3(kept.axis[a]), inward[a]);
      ASSERT_LT(distance, kMaxTurn) << code;
      square_sum += distance * distance;
      ++directions;
      for (size_t b = 0; b < inward.size(); ++b)
        ASSERT_NEAR(glm::dot(kept.axis[a], kept.axis[b]), a == b, 1e-5);
    }
  }
  EXPECT_LT(std::sqrt(square_sum / directions), 0.006);
}

TEST(BorderCode, AlongTheFramesOwnAxes) {
  for (const double sign : {1.0, -1.0})
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 along(0.0);
      along[axis] = sign;
      const InwardAxes kept = inwardAxes(packBorderCode({&along, 1}));
      EXPECT_LT(glm::distance(glm::dvec3(kept.axis[0]), along), 0.012) << axis << sign;
    }
}

TEST(BorderCode, OfNoDirectionIsAWholeCell) {
  EXPECT_EQ(packBorderCode({}), kNoBorder);
  EXPECT_EQ(inwardAxes(kNoBorder).count, 0);
  EXPECT_TRUE(isPossibleBorderCode(kNoBorder));
}

TEST(BorderCode, IsRefusedWhereNothingPacksToIt) {
  EXPECT_FALSE(isPossibleBorderCode(0x00000004));  // reversed, but no axis
  EXPECT_FALSE(isPossibleBorderCode(0x01000000));
  EXPECT_TRUE(isPossibleBorderCode(0x00000021));
  EXPECT_FALSE(isPossibleBorderCode(0x010000b4));  // neither a ratio nor layers
  EXPECT_FALSE(isPossibleBorderCode(0x010000bc));
  EXPECT_TRUE(isPossibleBorderCode(0x000000c4));
}

TEST(LayersBehindFaces, KeepTheirDirections) {
  std::mt19937 random(4);
  for (int n = 0; n < 3000; ++n) {
    glm::dmat3 axes = randomAxes(random);
    const size_t ends = static_cast<size_t>(n % 3), layers = 1 + static_cast<size_t>(n / 3 % (3 - n % 3));
    if (ends == 0 && layers == 1) continue;  // of the other form
    if (ends == 0 && glm::dot(glm::cross(axes[0], axes[1]), axes[2]) < 0) axes[2] = -axes[2];
    const uint32_t code = packLayersCode({&axes[0], ends + layers}, ends);
    ASSERT_TRUE(isPossibleBorderCode(code));
    const InwardAxes kept = inwardAxes(code);
    ASSERT_EQ(kept.count, static_cast<int>(ends));
    EXPECT_EQ(kept.faces, (1u << ends) - 1);
    EXPECT_EQ(layersOf(code), ((1u << (ends + layers)) - 1) & ~kept.faces);
    EXPECT_FALSE(kept.behind);
    for (size_t a = 0; a < ends + layers; ++a)
      ASSERT_LT(glm::distance(glm::dvec3(kept.axis[a]), axes[static_cast<int>(a)]), kMaxTurn) << code;
    EXPECT_EQ(borderReach(code), ends > 0 ? kCutReach : 0);
    if (ends == 0) {
      EXPECT_DOUBLE_EQ(drawnSlope({1, 2, 2}, code), 3);
    }
  }
}

TEST(BorderCode, OfAnyBytesHasFiniteUnitAxes) {
  std::mt19937 random(2);
  for (int n = 0; n < 3000; ++n) {
    const InwardAxes axes = inwardAxes(static_cast<uint32_t>(random()) | 1);
    for (int a = 0; a < axes.count; ++a) ASSERT_NEAR(glm::length(axes.axis[a]), 1, 1e-4);
  }
}

TEST(LayerBehindAFace, KeepsItsDirectionAndDistance) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int n = 0; n < 3000; ++n) {
    const glm::dvec3 inward = randomAxes(random)[0];
    const double distance = 0.01 + 1.97 * unit(random);
    const uint32_t code = packLayerCode(inward, distance);
    ASSERT_TRUE(isPossibleBorderCode(code));
    const InwardAxes kept = inwardAxes(code);
    ASSERT_TRUE(kept.behind);
    ASSERT_EQ(kept.count, 1);
    EXPECT_TRUE(kept.hasFace(0));
    ASSERT_LT(glm::distance(glm::dvec3(kept.axis[0]), inward), 0.02) << code;
    ASSERT_NEAR(kept.distance, distance, 0.5 / 128 + 1e-9);
    EXPECT_EQ(borderReach(code), 0);
  }
  for (const double outside : {-1.0, 0.0, 2.5, 1e300, std::nan("")})
    EXPECT_EQ(packLayerCode({0, 0, 1}, outside), kNoBorder) << outside;
  EXPECT_FALSE(isPossibleBorderCode(0x00000104));
}

TEST(MergedSplatAtAFace, KeepsItsDirectionDistanceAndRatio) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int n = 0; n < 3000; ++n) {
    const glm::dvec3 inward = randomAxes(random)[0];
    const double distance = 0.01 + 0.99 * unit(random), ratio = 0.75 * std::exp2(2 * unit(random));
    const uint32_t code = packMergedCode(inward, distance, ratio);
    ASSERT_TRUE(isPossibleBorderCode(code));
    const InwardAxes kept = inwardAxes(code);
    ASSERT_EQ(kept.count, 1);
    EXPECT_TRUE(kept.hasFace(0));
    EXPECT_FALSE(kept.behind);
    ASSERT_LT(glm::distance(glm::dvec3(kept.axis[0]), inward), 0.02) << code;
    ASSERT_NEAR(kept.distance, distance, 0.5 / 128 + 1e-9);
    ASSERT_NEAR(std::log2(kept.ratio / std::min(ratio, 1.5 / kept.distance)), 0, 0.051);
    const BorderPart part = mergedPart(kept);
    EXPECT_LE(part.offset + kKernelSupport * (part.size - 1), kMergedReach);
    EXPECT_GE(borderReach(code), part.offset + kKernelSupport * (part.size - 1));
    EXPECT_GT(part.size, 0);
    EXPECT_GT(part.share, 1);
  }
  for (const double outside : {-1.0, 0.0, 1.1, 1e300, std::nan("")})
    EXPECT_EQ(packMergedCode({0, 0, 1}, outside, 1), kNoBorder) << outside;
  for (const double ratio : {-1.0, 0.0, std::nan("")})
    EXPECT_EQ(packMergedCode({0, 0, 1}, 0.5, ratio), kNoBorder) << ratio;
  EXPECT_TRUE(isPossibleBorderCode(0x400000ac));
  EXPECT_FALSE(isPossibleBorderCode(0x400000b4));  // a ratio that is too large
  EXPECT_FALSE(isPossibleBorderCode(0x8100000c));  // too far from the face
}

TEST(MergedSplatAtAFace, IsDrawnAsACellIs) {
  const auto expect_like = [](const BorderPart& cell, double ratio) {
    const BorderPart part = mergedPart(inwardAxes(packMergedCode({0, 0, 1}, 0.5, ratio)));
    EXPECT_NEAR(part.offset, cell.offset, 0.04 * ratio) << ratio;
    EXPECT_NEAR(part.size, cell.size, 0.04 * ratio) << ratio;
    EXPECT_NEAR(part.share, cell.share, 0.04 * ratio) << ratio;
  };
  expect_like(kWholeCellStyle.cut, 1);
  expect_like(kHalfCellStyle.cut, 2);
}

TEST(BorderCode, SlopesAreThoseThatAreDrawn) {
  const glm::dvec3 inward[] = {{0, 0, 1}}, slope(0.3, 0, 0.4);
  EXPECT_DOUBLE_EQ(drawnSlope(slope, kNoBorder), 0.5);
  EXPECT_DOUBLE_EQ(drawnSlope(slope, packBorderCode(inward)), 0.5);
  const double wide = (kHalfCellStyle.cut.size + 0.13) * 0.4;
  EXPECT_NEAR(drawnSlope(slope, packBorderCode(inward, 1)), std::hypot(0.3, wide), 0.01);
}

TEST(BorderCode, ItsPartsHaveItsWeight) {
  for (const BorderStyle& style : {kHalfCellStyle, kWholeCellStyle}) {
    float sum = 0;
    for (const BorderPart& part : style.parts) {
      sum += part.share;
      EXPECT_LE(std::sqrt(3.0f) * part.offset, kPartsReach);
      EXPECT_LE(part.size, 1);
    }
    EXPECT_FLOAT_EQ(sum, 1);
  }
}

}  // namespace
}  // namespace curvisplat
