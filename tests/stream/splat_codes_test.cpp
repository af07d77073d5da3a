// Codes of what a splat has beside its shape: of borders and of growth. Codes of logarithms that are found
// several at once are those by std::log(), in every instruction set.
#include <gtest/gtest.h>
#include <hwy/highway.h>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "stream/codec/log_codes.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "stream/model/kernel.h"

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

using Axes = std::array<glm::dvec3, 3>;
using Growth = std::array<double, 3>;

/// Axes at right angles, of either handedness.
Axes turnedAxes(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const glm::dmat3 turn = glm::mat3_cast(
      glm::normalize(glm::dquat(normal(random), normal(random), normal(random), normal(random))));
  return {turn[0], turn[1], random() & 1 ? -turn[2] : turn[2]};
}

/// The third moment in a direction: what axes and growths stand for, whatever their order and signs.
double momentAlong(const Axes& axis, const Growth& growth, const glm::dvec3& direction) {
  double sum = 0;
  for (size_t n = 0; n < 3; ++n) sum += growth[n] * std::pow(glm::dot(axis[n], direction), 3);
  return sum;
}

double momentAlong(const CellGrowth& cell, const glm::dvec3& direction) {
  double sum = 0;
  for (size_t n = 0; n < 3; ++n)
    sum += cell.growth[n] * std::pow(glm::dot(glm::dvec3(cell.axis[n]), direction), 3);
  return sum;
}

TEST(GrowthCode, KeepsTheThirdMoment) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> around(-0.6, 0.6);
  for (int n = 0; n < 3000; ++n) {
    const Axes axis = turnedAxes(random);
    Growth growth{};
    for (int a = 0; a < 1 + n % 3; ++a) growth[(a + n) % 3] = around(random);
    const uint32_t code = packGrowthCode(axis, growth);
    ASSERT_TRUE(isPossibleGrowthCode(code));
    const CellGrowth kept = cellGrowth(code);
    for (int m = 0; m < 10; ++m) {
      const glm::dvec3 direction = turnedAxes(random)[0];
      // Half a step of the growth, and 5 degrees.
      ASSERT_NEAR(momentAlong(kept, direction), momentAlong(axis, growth, direction), 0.14) << code;
    }
    for (size_t a = 0; a < 3; ++a)
      for (size_t b = 0; b < 3; ++b) ASSERT_NEAR(glm::dot(kept.axis[a], kept.axis[b]), a == b, 1e-5);
  }
}

TEST(GrowthCode, AlongTheFramesOwnAxesIsWithoutRotation) {
  const Axes frame{glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)};
  const uint32_t along_z = packGrowthCode(frame, {0, 0, 0.25});
  EXPECT_EQ(along_z, 8u << 12);
  // The same moment, seen from other axes.
  EXPECT_EQ(packGrowthCode({-frame[2], frame[0], frame[1]}, {-0.25, 0, 0}), along_z);
  const uint32_t all = packGrowthCode(frame, {0.25, -0.125, 0.0625});
  EXPECT_EQ(packGrowthCode({frame[1], -frame[0], -frame[2]}, {-0.125, -0.25, -0.0625}), all);
  const CellGrowth kept = cellGrowth(all);
  EXPECT_EQ(kept.growth[0], 0.25f);
  EXPECT_EQ(kept.growth[1], -0.125f);
  EXPECT_EQ(kept.growth[2], 0.0625f);
}

TEST(GrowthCode, OfLittleGrowthIsNone) {
  const Axes frame{glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)};
  EXPECT_EQ(packGrowthCode(frame, {0.015, -0.015, 0}), kNoGrowth);
  EXPECT_NE(packGrowthCode(frame, {0.02, 0, 0}), kNoGrowth);
  EXPECT_EQ(cellGrowth(packGrowthCode(frame, {9, 0, 0})).growth[0], 0.625f);
  for (const float growth : cellGrowth(kNoGrowth).growth) EXPECT_EQ(growth, 0);
}

TEST(GrowthCode, IsRefusedWhereNothingPacksToIt) {
  EXPECT_TRUE(isPossibleGrowthCode(kNoGrowth));
  EXPECT_TRUE(isPossibleGrowthCode(20));
  EXPECT_FALSE(isPossibleGrowthCode(21));            // a growth beyond the largest
  EXPECT_FALSE(isPossibleGrowthCode(1u << 18));      // a rotation without growth
  EXPECT_FALSE(isPossibleGrowthCode(1 | 8u << 18));  // -8
  EXPECT_FALSE(isPossibleGrowthCode(1 | 1u << 30));
}

void expectCodesOfLogs(const std::vector<double>& values, double step) {
  std::vector<uint32_t> codes(values.size());
  const std::optional<LogCodes> found = logCodes(values, step, 0xffff, codes.data());
  ASSERT_TRUE(found);
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (const double value : values) {
    lowest = std::min(lowest, std::log(value));
    highest = std::max(highest, std::log(value));
  }
  EXPECT_EQ(found->lowest, lowest);
  EXPECT_EQ(found->largest, static_cast<uint32_t>((highest - lowest) / step) + 1);
  for (size_t n = 0; n < values.size(); ++n)
    ASSERT_EQ(codes[n], static_cast<uint32_t>((std::log(values[n]) - lowest) / step + 0.5)) << values[n];
}

class LogCodesTest : public testing::TestWithParam<int64_t> {
 protected:
  LogCodesTest() { hwy::SetSupportedTargetsForTest(GetParam()); }
  ~LogCodesTest() override { hwy::SetSupportedTargetsForTest(0); }
};
INSTANTIATE_TEST_SUITE_P(Targets, LogCodesTest, testing::ValuesIn(hwy::SupportedAndGeneratedTargets()),
                         [](const auto& target) { return hwy::TargetName(target.param); });

TEST_P(LogCodesTest, AreThoseByTheLibrary) {
  std::mt19937_64 random(1);
  for (const size_t count : {1u, 2u, 7u, 8u, 9u, 1000u, 20001u}) {
    for (const double scale : {1.0, 1e-30, 1e30, 1e-300}) {
      std::uniform_real_distribution<double> exponent(-40, 40);
      std::vector<double> values(count);
      for (double& value : values) value = scale * std::exp(exponent(random));
      expectCodesOfLogs(values, 0.014);
      expectCodesOfLogs(values, 0.0016);
    }
  }
}

TEST_P(LogCodesTest, BetweenTwoCodesAreThoseByTheLibrary) {
  // Half a step from a code, and the next numbers to either side.
  constexpr double kStep = 0.014;
  std::vector<double> values{1};
  for (int n = 0; n < 5000; ++n) {
    double value = std::exp((n + 0.5) * kStep);
    for (int m = 0; m < 4; ++m) value = std::nextafter(value, 0.0);
    for (int m = 0; m < 8; ++m) values.push_back(value = std::nextafter(value, 1e300));
  }
  expectCodesOfLogs(values, kStep);
}

TEST_P(LogCodesTest, OfEqualValuesAreZero) {
  expectCodesOfLogs(std::vector<double>(77, 0.3), 0.014);
  expectCodesOfLogs(std::vector<double>(77, std::numeric_limits<double>::denorm_min()), 0.014);
}

TEST_P(LogCodesTest, ThatDoNotFitAreRefused) {
  std::vector<uint32_t> codes(9);
  std::vector<double> values(9, 1.0);
  values[8] = std::exp(100 * 0.014);
  EXPECT_TRUE(logCodes(values, 0.014, 101, codes.data()));
  EXPECT_FALSE(logCodes(values, 0.014, 100, codes.data()));
  values[8] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(logCodes(values, 0.014, 100, codes.data()));
  values[8] = 0;  // a volume that underflows
  EXPECT_FALSE(logCodes(values, 0.014, 100, codes.data()));
  std::fill(values.begin(), values.end(), 0.0);
  EXPECT_FALSE(logCodes(values, 0.014, 100, codes.data()));
}

}  // namespace
}  // namespace curvisplat
