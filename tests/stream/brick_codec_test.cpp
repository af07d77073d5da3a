// The codec's promises, over bricks without any order and over smooth ones.
#include "stream/codec/brick_codec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <ostream>
#include <random>

#include "stream/base/error.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

constexpr double kKernelDeviation = 0.44655;
constexpr double kKernelRadius = 1.556228;

double frobenius(const glm::dmat3& m) {
  double sum = 0;
  for (int column = 0; column < 3; ++column) sum += glm::dot(m[column], m[column]);
  return std::sqrt(sum);
}

/// A⁻¹ B for lower triangular A and B, by forward substitution.
glm::dmat3 solve(const glm::dmat3& a, const glm::dmat3& b) {
  glm::dmat3 x(0.0);
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) {
      double sum = b[column][row];
      for (int c = 0; c < row; ++c) sum -= a[c][row] * x[column][c];
      x[column][row] = sum / a[row][row];
    }
  return x;
}

/// The largest singular value by power iteration on A Aᵀ: slow, and another way than the codec's.
double largestSingular(const glm::dmat3& a) {
  glm::dmat3 power = a * glm::transpose(a);
  double log_scale = 0;
  for (int n = 0; n < 40; ++n) {
    const double norm = frobenius(power);
    power = (power / norm) * (power / norm);
    log_scale = 2 * (log_scale + std::log(norm));
  }
  return std::exp(0.5 * (std::log(frobenius(power)) + log_scale) / std::ldexp(1.0, 40));
}

double smallestSingular(const glm::dmat3& a) {
  return 1 / largestSingular(solve(a, glm::dmat3(1.0)));
}

struct Span {
  double least = std::numeric_limits<double>::infinity(), most = -least, all = 0;
  explicit Span(const std::vector<SplatScalar>& values) {
    for (const SplatScalar& v : values) {
      least = std::min(least, v.mean);
      most = std::max(most, v.mean);
      for (int c = 0; c < 3; ++c) all = std::max(all, std::abs(v.slope[c]));
      all = std::max(all, std::sqrt(v.variance));
    }
    all = std::max(all, most - least);
  }
};

void expectGeometryHeld(const RootCube& root, const BrickSplats& in, const BrickSplats& out) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Splat& splat : in.splats) smallest = std::min(smallest, smallestSingular(splat.factor()));
  const double finest = std::ldexp(root.cellSize(in.cell.level), -32);
  const double allowed =
      std::max(0.05 * kKernelDeviation * smallest * (1 + 1e-6), finest) + std::ldexp(root.size, -48);
  for (size_t n = 0; n < in.size(); ++n) {
    const glm::dvec3 error = root.toWorld(out.positions[n]) - root.toWorld(in.positions[n]);
    ASSERT_LE(glm::length(error), allowed) << n;
    const uint32_t voxels = std::min(in.cell.level + 5, uint32_t{kPositionBits});
    for (int axis = 0; axis < 3; ++axis)
      ASSERT_EQ(out.positions[n].at[axis] >> (kPositionBits - voxels),
                in.positions[n].at[axis] >> (kPositionBits - voxels));

    const glm::dmat3 m = solve(in.splats[n].factor(), out.splats[n].factor());
    ASSERT_LE(frobenius(m * glm::transpose(m) - glm::dmat3(1.0)), 0.05) << n;

    const double weight = in.splats[n].weight;
    if (weight == 0)
      ASSERT_EQ(out.splats[n].weight, 0);
    else
      ASSERT_NEAR(out.splats[n].weight / weight, 1, 2e-3);
  }
}

void expectValuesHeld(const std::vector<SplatScalar>& in, const std::vector<SplatScalar>& out) {
  const Span span(in);
  const double largest = std::max(std::abs(span.least), std::abs(span.most));
  const double rounding = 1e-7;  // of floats
  for (size_t n = 0; n < in.size(); ++n) {
    ASSERT_NEAR(out[n].mean, in[n].mean, (span.most - span.least) / 131070 * (1 + 1e-6) + rounding * largest);
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(out[n].slope[c], in[n].slope[c], span.all * (1.0 / 2048 + rounding));
    ASSERT_NEAR(std::sqrt(out[n].variance), std::sqrt(in[n].variance), span.all * (1.0 / 8192 + rounding));
    if (in[n].variance == 0) {
      ASSERT_EQ(out[n].variance, 0);
    }
  }
}

/// Expects that decoding gives what encoding said it would.
void expectDecodes(const RootCube& root, const EncodedBrick& encoded, const BrickSplats& said) {
  const BrickSplats back =
      decodeForMerging(root, encoded.brick, encoded.geometry, encoded.variables, encoded.values);
  ASSERT_EQ(back.positions, said.positions);
  ASSERT_EQ(back.runs, said.runs);
  SplatGeometry floats;
  std::vector<NodeRun> runs;
  decodeGeometry(root, encoded.brick, encoded.geometry, floats, &runs);
  ASSERT_EQ(floats.size(), said.size());
  ASSERT_EQ(runs, said.runs);
  const double size = root.cellSize(said.cell.level);
  const glm::dvec3 corner = root.cellMin(said.cell);
  for (size_t n = 0; n < said.size(); ++n) {
    ASSERT_EQ(back.splats[n].axis, said.splats[n].axis);
    ASSERT_EQ(back.splats[n].shear, said.splats[n].shear);
    ASSERT_EQ(back.splats[n].weight, said.splats[n].weight);
    ASSERT_EQ(floats.axis2[n], static_cast<float>(said.splats[n].axis[2]));
    ASSERT_EQ(floats.shear20[n], static_cast<float>(said.splats[n].shear[1]));
    ASSERT_EQ(floats.weight[n], static_cast<float>(said.splats[n].weight));
    const glm::dvec3 local = root.toWorld(said.positions[n]) - corner;
    const double slack = 1e-7 * size + 1e-15 * (glm::length(root.min) + root.size);
    ASSERT_NEAR(floats.x[n], local.x, slack);
    ASSERT_NEAR(floats.y[n], local.y, slack);
    ASSERT_NEAR(floats.z[n], local.z, slack);
    ASSERT_GE(floats.x[n], 0);
    ASSERT_LT(floats.x[n], size);
  }
  for (size_t v = 0; v < said.variables.size(); ++v)
    for (size_t n = 0; n < said.size(); ++n) {
      ASSERT_EQ(back.variables[v][n].mean, said.variables[v][n].mean);
      ASSERT_EQ(back.variables[v][n].slope, said.variables[v][n].slope);
      ASSERT_EQ(back.variables[v][n].variance, said.variables[v][n].variance);
    }
}

void expectSummary(const RootCube& root, const EncodedBrick& encoded, const BrickSplats& said) {
  const Brick& brick = encoded.brick;
  ASSERT_EQ(brick.cell, said.cell);
  ASSERT_EQ(brick.splats, said.size());
  std::array<uint32_t, 8> octants{};
  double largest = 0, weight = 0;
  for (size_t n = 0; n < said.size(); ++n) {
    ++octants[octantOf(said.positions[n], said.cell)];
    const glm::dvec3 centre = root.toWorld(said.positions[n]);
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_LE(brick.lower[axis], centre[axis]);
      ASSERT_GE(brick.upper[axis], centre[axis]);
    }
    largest = std::max(largest, kKernelRadius * largestSingular(said.splats[n].factor()));
    weight += said.splats[n].weight;
  }
  EXPECT_EQ(brick.octant_splats, octants);
  EXPECT_GE(brick.largest_radius, largest * (1 - 1e-9));
  EXPECT_LE(brick.largest_radius, largest * (1 + 1e-5));
  EXPECT_NEAR(encoded.weight, weight, 1e-12 * weight);
  for (size_t v = 0; v < said.variables.size(); ++v) {
    const BrickVariable& variable = encoded.variables[v];
    double slope = 0, variance = 0;
    const Span span(said.variables[v]);
    for (const SplatScalar& value : said.variables[v]) {
      slope = std::max(slope, glm::length(value.slope));
      variance = std::max(variance, value.variance);
    }
    EXPECT_EQ(variable.min, span.least);
    EXPECT_EQ(variable.max, span.most);
    EXPECT_GE(variable.largest_slope, slope);
    EXPECT_LE(variable.largest_slope, slope * (1 + 1e-6) + 1e-38);
    EXPECT_GE(variable.largest_deviation, std::sqrt(variance));
    EXPECT_LE(variable.largest_deviation, std::sqrt(variance) * (1 + 1e-6) + 1e-38);
  }
}

void expectHeld(const RootCube& root, const BrickSplats& in) {
  BrickSplats out = in;
  const EncodedBrick encoded = encodeBrick(root, out);
  expectGeometryHeld(root, in, out);
  for (size_t v = 0; v < in.variables.size(); ++v) expectValuesHeld(in.variables[v], out.variables[v]);
  expectDecodes(root, encoded, out);
  expectSummary(root, encoded, out);
}

struct Case {
  std::string name;
  RandomBrick like;
  Cell cell;
};

void PrintTo(const Case& tested, std::ostream* out) {
  *out << tested.name;
}

class RandomBricks : public testing::TestWithParam<Case> {};

TEST_P(RandomBricks, KeepTheBounds) {
  const RandomBrick& like = GetParam().like;
  const RootCube root{glm::dvec3(-0.3, 0.1, 2.0) * like.unit, like.unit};
  const uint64_t seeds = faults::isWholeSweep() ? 3 : 1;
  for (uint64_t seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE(seed);
    expectHeld(root, randomBrick(like, GetParam().cell, seed));
  }
}

RandomBrick with(void (*change)(RandomBrick&)) {
  RandomBrick like;
  change(like);
  return like;
}

INSTANTIATE_TEST_SUITE_P(
    Codec, RandomBricks,
    testing::Values(
        Case{"plain", {}, {}}, Case{"inner", with([](RandomBrick& b) { b.leaf = false; }), {}},
        Case{"one_splat", with([](RandomBrick& b) { b.splats = 1; }), {3, {1, 2, 7}}},
        Case{"two_splats", with([](RandomBrick& b) { b.splats = 2; }), {}},
        Case{"full", with([](RandomBrick& b) { b.splats = kMaxBrickSplats; }), {}},
        Case{"spheres", with([](RandomBrick& b) { b.aspect = 1; }), {}},
        Case{"aspect_1e4", with([](RandomBrick& b) { b.aspect = 1e4; }), {}},
        Case{"aspect_1e6", with([](RandomBrick& b) { b.aspect = 1e6; }), {}},
        Case{"aspect_1e10", with([](RandomBrick& b) { b.aspect = 1e10; }), {}},
        Case{"big_splats", with([](RandomBrick& b) { b.axis = 10; }), {}},
        Case{"deepest", with([](RandomBrick& b) { b.axis = 1e-9; }), {24, {0, 1, (1u << 24) - 1}}},
        Case{"tiny_units", with([](RandomBrick& b) { b.unit = 1e-12, b.value = 1e-15; }), {}},
        Case{"huge_units", with([](RandomBrick& b) { b.unit = 1e9, b.value = 1e20; }), {5, {9, 3, 1}}},
        Case{"no_variable", with([](RandomBrick& b) { b.variables = 0; }), {}},
        Case{"three_variables", with([](RandomBrick& b) { b.variables = 3; }), {}},
        Case{"constant_zero", with([](RandomBrick& b) { b.value = 0; }), {}}),
    [](const auto& tested) { return tested.param.name; });

TEST(Codec, KeepsCoincidentSplats) {
  BrickSplats brick = randomBrick({}, Cell{}, 1);
  for (size_t n = 0; n < brick.size(); ++n) {
    brick.positions[n] = brick.positions[0];
    brick.splats[n] = brick.splats[0];
  }
  expectHeld(RootCube{}, brick);
}

TEST(Codec, KeepsConstantValuesExactly) {
  BrickSplats brick = randomBrick({}, Cell{}, 2);
  for (SplatScalar& value : brick.variables[0]) value = {0.7f, glm::dvec3(0.0), 0};
  const BrickSplats before = brick;
  encodeBrick(RootCube{}, brick);
  for (const SplatScalar& value : brick.variables[0]) {
    ASSERT_EQ(value.mean, 0.7f);
    ASSERT_EQ(value.slope, glm::dvec3(0.0));
  }
}

/// Values within 1 of 100 but for a tail to ±30,000, as at degenerate cells.
BrickSplats longTailed() {
  BrickSplats brick = randomBrick({}, Cell{}, 2);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (SplatScalar& value : brick.variables[0]) {
    const double scale = std::exp(12 * std::pow(std::abs(uniform(random)), 4)) / 6;
    value = {100 + scale * uniform(random),
             scale * glm::dvec3(uniform(random), uniform(random), uniform(random)),
             uniform(random) > 0 ? 0 : scale * scale};
  }
  return brick;
}

TEST(Codec, KeepsValuesByTheirOwnScale) {
  const ValueSpread spread{100, 0.5};
  BrickSplats brick = longTailed();
  const std::vector<SplatScalar> before = brick.variables[0];
  const std::vector<ValueCoding> codings{{ValuePrecision::kAuto, spread}};
  const EncodedBrick encoded = encodeBrick(RootCube{}, brick, codings);
  EXPECT_STREQ(featureOf(encoded.values[0]), kScaledValues);
  const auto [means, slopes] = errorsOf(encoded.values[0], encoded.variables[0].largest_slope);
  size_t far = 0;
  for (size_t n = 0; n < before.size(); ++n) {
    const SplatScalar &was = before[n], &is = brick.variables[0][n];
    const double own = spread.scaleAt(was.mean), rounding = 1e-7 * std::abs(was.mean);
    ASSERT_NEAR(is.mean, was.mean, own / 2000 + rounding);
    ASSERT_NEAR(is.mean, was.mean, means.largest + rounding);
    for (int c = 0; c < 3; ++c) {
      ASSERT_NEAR(is.slope[c], was.slope[c], (own + std::abs(was.slope[c])) / 1000);
      ASSERT_NEAR(is.slope[c], was.slope[c], 1.01 * slopes.largest);
    }
    ASSERT_NEAR(std::sqrt(is.variance), std::sqrt(was.variance), (own + std::sqrt(was.variance)) / 1000);
    if (was.variance == 0) {
      ASSERT_EQ(is.variance, 0);
    }
    far += own > 1000;
  }
  EXPECT_GT(far, 10u);
  SplatVariable decoded;
  decodeVariable(encoded.brick, encoded.variables[0], encoded.values[0], decoded);
  for (size_t n = 0; n < before.size(); ++n) {
    ASSERT_EQ(decoded.mean[n], brick.variables[0][n].mean);
    ASSERT_EQ(decoded.slope2[n], brick.variables[0][n].slope.z);
    ASSERT_EQ(decoded.variance[n], brick.variables[0][n].variance);
  }
  // Even steps lose what lies near the centre.
  BrickSplats even = longTailed();
  encodeBrick(RootCube{}, even);
  double worst = 0;
  for (size_t n = 0; n < before.size(); ++n)
    worst = std::max(worst, std::abs(even.variables[0][n].mean - before[n].mean));
  EXPECT_GT(worst, spread.scale / 10);
}

TEST(Codec, ByOwnScaleIsAsBeforeWhereStepsAreFineAnyway) {
  BrickSplats brick = longTailed(), same = brick;
  const std::vector<ValueCoding> codings{{ValuePrecision::kAuto, {0, 1e6}}};
  EXPECT_EQ(encodeBrick(RootCube{}, brick, codings).values, encodeBrick(RootCube{}, same).values);
}

TEST(Codec, RefusesScalesThatAreNone) {
  BrickSplats brick = longTailed();
  const std::vector<ValueCoding> codings{{ValuePrecision::kAuto, {100, 0.5}}};
  const EncodedBrick encoded = encodeBrick(RootCube{}, brick, codings);
  SplatVariable decoded;
  for (const double scale : {0.0, -1.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
    std::vector<std::byte> bytes = encoded.values[0];
    std::memcpy(&bytes[offsetof(ValuesHeader, slope_step)], &scale, sizeof scale);
    EXPECT_THROW(decodeVariable(encoded.brick, encoded.variables[0], bytes, decoded), Error) << scale;
  }
}

TEST(Codec, KeepsHalfCells) {
  const RootCube root{};
  BrickSplats brick = randomBrick({}, Cell{}, 6);
  const size_t without = encodeBrick(root, brick).geometry.size();
  BrickSplats whole_brick = brick;
  brick.border_codes.assign(brick.size(), kNoBorder);
  EXPECT_EQ(encodeBrick(root, brick).geometry.size(), without);

  const glm::dvec3 inward[] = {{0, 0.6, 0.8}, {1, 0, 0}};
  for (size_t n = 0; n < brick.size(); n += 3) brick.border_codes[n] = packBorderCode({inward, 1 + n % 2});
  EXPECT_NEAR(
      encodeBrick(root, brick).brick.largest_radius / encodeBrick(root, whole_brick).brick.largest_radius,
      1 + kPartsReach / kKernelRadius, 1e-6);
  for (size_t n = 0; n < brick.size(); n += 6) brick.border_codes[n] = packBorderCode({inward, 1 + n % 2}, 1);
  const EncodedBrick encoded = encodeBrick(root, brick);
  EXPECT_EQ(
      decodeForMerging(root, encoded.brick, encoded.geometry, encoded.variables, encoded.values).border_codes,
      brick.border_codes);
  SplatGeometry floats;
  decodeGeometry(root, encoded.brick, encoded.geometry, floats);
  EXPECT_EQ(floats.border_code, brick.border_codes);
  // Scratch of the brick before is not taken for this one's.
  brick.border_codes.clear();
  const EncodedBrick whole = encodeBrick(root, brick);
  decodeGeometry(root, whole.brick, whole.geometry, floats);
  EXPECT_EQ(floats.border_code, std::vector<uint32_t>(brick.size(), kNoBorder));
  EXPECT_NEAR(encoded.brick.largest_radius / whole.brick.largest_radius, 1 + kCutReach / kKernelRadius, 1e-6);
}

TEST(Codec, KeepsGrowth) {
  const RootCube root{};
  BrickSplats brick = randomBrick({}, Cell{}, 6);
  const size_t without = encodeBrick(root, brick).geometry.size();
  brick.growth_codes.assign(brick.size(), kNoGrowth);
  EXPECT_EQ(encodeBrick(root, brick).geometry.size(), without);

  const std::array<glm::dvec3, 3> axes{glm::dvec3(0, 0.6, 0.8), {1, 0, 0}, {0, -0.8, 0.6}};
  for (size_t n = 0; n < brick.size(); n += 3)
    brick.growth_codes[n] = packGrowthCode(axes, {0.2, n % 2 == 0 ? 0 : -0.5, 0.1});
  const EncodedBrick encoded = encodeBrick(root, brick);
  EXPECT_EQ(
      decodeForMerging(root, encoded.brick, encoded.geometry, encoded.variables, encoded.values).growth_codes,
      brick.growth_codes);
  SplatGeometry floats;
  decodeGeometry(root, encoded.brick, encoded.geometry, floats);
  EXPECT_EQ(floats.growth_code, brick.growth_codes);
  // Scratch of the brick before is not taken for this one's.
  brick.growth_codes.clear();
  const EncodedBrick steady = encodeBrick(root, brick);
  decodeGeometry(root, steady.brick, steady.geometry, floats);
  EXPECT_EQ(floats.growth_code, std::vector<uint32_t>(brick.size(), kNoGrowth));
}

TEST(Codec, RefusesGrowthThatIsNone) {
  const RootCube root{};
  BrickSplats brick = randomBrick({}, Cell{}, 6);
  brick.growth_codes.assign(brick.size(), kNoGrowth);
  brick.growth_codes[1] = 21;  // a growth beyond the largest
  const EncodedBrick encoded = encodeBrick(root, brick);
  SplatGeometry floats;
  EXPECT_THROW(decodeGeometry(root, encoded.brick, encoded.geometry, floats), Error);
}

TEST(Codec, CutsOffVariancesThatNoFloatHolds) {
  RandomBrick like;
  like.value = 1e30;
  const RootCube root{};
  BrickSplats brick = randomBrick(like, Cell{}, 2);
  const EncodedBrick encoded = encodeBrick(root, brick);
  SplatVariable values;
  decodeVariable(encoded.brick, encoded.variables[0], encoded.values[0], values);
  EXPECT_EQ(*std::max_element(values.variance.begin(), values.variance.end()),
            std::numeric_limits<float>::max());
  EXPECT_GT(*std::max_element(values.mean.begin(), values.mean.end()), 0.9e30f);
}

TEST(Codec, KeepsAllWeightsZero) {
  BrickSplats brick = randomBrick({}, Cell{}, 3);
  for (Splat& splat : brick.splats) splat.weight = 0;
  expectHeld(RootCube{}, brick);
}

TEST(Codec, KeepsWeightsFarFromTheVolume) {
  BrickSplats brick = randomBrick({}, Cell{}, 4);
  for (size_t n = 0; n < brick.size(); ++n) brick.splats[n].weight *= std::pow(10.0, n % 2 ? 30 : -30);
  expectHeld(RootCube{}, brick);
  brick.splats[0].weight = 1e-300;  // and those that only raw numbers hold
  expectHeld(RootCube{}, brick);
}

TEST(Codec, KeepsTheSumOfWeightsOfCellsThatAreAlike) {
  BrickSplats brick = randomBrick({}, Cell{}, 4);
  for (const double ratio : {1.0, 1.0008, 1.237, 0.7411, 1 / 6.0}) {  // to the volume of the axes
    for (Splat& splat : brick.splats) {
      splat.axis = {1.7e-3, 1.1e-3, 0.7e-3};
      splat.weight = ratio * splat.axis[0] * splat.axis[1] * splat.axis[2];
    }
    const double weight = brick.splats[0].weight;
    BrickSplats out = brick;
    const EncodedBrick encoded = encodeBrick(RootCube{}, out);
    EXPECT_NEAR(encoded.weight / (weight * static_cast<double>(out.size())), 1, 2e-5) << ratio;
    for (const Splat& splat : out.splats) ASSERT_NEAR(splat.weight / weight, 1, 2e-3);
  }
}

TEST(Codec, KeepsShapesThatOnlyRawNumbersHold) {
  BrickSplats brick = randomBrick({}, Cell{}, 5);
  for (size_t n = 0; n < brick.size(); ++n) {
    brick.splats[n].axis = {1, 1e-3 * (1 + 1e-3 * static_cast<double>(n)), 1e-12};
    brick.splats[n].weight = 0;
  }
  expectHeld(RootCube{}, brick);
}

TEST(Codec, PredictsAlongAndAcrossRows) {
  // The same smooth grid, with and without its rows known: the rows must pay.
  const RootCube root{};
  BrickSplats brick;
  RandomBrick like;
  like.splats = 32 * 32 * 8;
  brick = randomBrick(like, Cell{}, 6);
  brick.runs.clear();
  for (uint64_t k = 0, n = 0; k < 8; ++k)
    for (uint64_t j = 0; j < 32; ++j) {
      brick.runs.push_back({2, 5, 100 + j, 7 + k, 32});
      for (uint64_t i = 0; i < 32; ++i, ++n) {
        const double u = 0.05 * static_cast<double>(i), v = std::exp(0.1 * static_cast<double>(j)),
                     w = 0.1 * static_cast<double>(k);
        brick.positions[n] = root.fromWorld({0.03 * v * std::cos(u), 0.03 * v * std::sin(u), w});
        brick.splats[n].axis = {1e-3, 1e-4 * v, 1e-2};
        brick.splats[n].shear = {std::sin(u), 0, 0};
        brick.splats[n].weight = 1e-9 * v;
        brick.variables[0][n] = {std::sin(u) * v, {0.05 * std::cos(u) * v, 0.1 * v, 0}, 0};
      }
    }
  expectHeld(root, brick);
  BrickSplats without = brick;
  without.runs.clear();
  const EncodedBrick known = encodeBrick(root, brick), unknown = encodeBrick(root, without);
  EXPECT_LT(known.geometry.size(), 3 * brick.size());
  EXPECT_LT(known.geometry.size(), unknown.geometry.size());
  EXPECT_LT(known.values[0].size(), 4 * brick.size());
  EXPECT_LT(known.values[0].size(), unknown.values[0].size());
}

TEST(Codec, TakesRunsInAnyOrder) {
  BrickSplats brick = randomBrick({}, Cell{}, 7);
  std::reverse(brick.runs.begin(), brick.runs.end());
  expectHeld(RootCube{}, brick);
  // Far apart, with gaps and overhangs between rows.
  brick.runs = {{0, 10, 5, 0, 300},
                {0, 0, 6, 0, 15},
                {0, 20, 6, 0, 200},
                {0, 230, 6, 0, 285},
                {0, uint64_t{1} << 40, 6, 0, 100},
                {7, 0, 0, uint64_t{1} << 50, 100}};
  expectHeld(RootCube{}, brick);
}

}  // namespace
}  // namespace curvisplat
