// Rows, predictors and planes by themselves: known answers, and bytes that lie; and what the codec does with
// bytes that are truncated, changed or hostile.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "stream/base/error.h"
#include "stream/codec/brick_codec.h"
#include "stream/codec/planes.h"
#include "stream/codec/prediction.h"
#include "stream/codec/values_codec.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

TEST(Rows, LieUnderTheRunsBefore) {
  //   j = 0:   i 10 .. 19                       splats 0 .. 9
  //   j = 1:   i 8 .. 11, i 15 .. 24            splats 10 .. 13, 14 .. 23
  //   k + 1, j = 1:  i 9 .. 16                  splats 24 .. 31: no row at j - 1, so k - 1
  const std::vector<NodeRun> runs{{0, 10, 0, 0, 10}, {0, 8, 1, 0, 4}, {0, 15, 1, 0, 10}, {0, 9, 1, 1, 8}};
  const std::vector<Row> expected{{0, 10, kNoRow}, {10, 2, kNoRow}, {12, 2, 0},      {14, 5, 5},
                                  {19, 5, kNoRow}, {24, 3, 11},     {27, 3, kNoRow}, {30, 2, 14}};
  EXPECT_TRUE(rowsOf(runs, 32) == expected);
}

TEST(Rows, OfRunsOutOfOrderHaveNoneAbove) {
  const std::vector<NodeRun> runs{{0, 0, 1, 0, 4}, {0, 0, 0, 0, 4}, {0, 0, 2, 0, 4}};
  EXPECT_TRUE(rowsOf(runs, 12) == (std::vector<Row>{{0, 4, kNoRow}, {4, 4, kNoRow}, {8, 4, kNoRow}}));
  EXPECT_TRUE(rowsOf({}, 7) == (std::vector<Row>{{0, 7, kNoRow}}));
}

TEST(Predictor, OfSmoothDataMissesNothing) {
  // v = 5 + 3 i + 100 j + i j: linear along i, its difference from the row above linear as well.
  std::vector<NodeRun> runs;
  std::vector<uint32_t> values;
  for (uint64_t j = 0; j < 6; ++j) {
    runs.push_back({0, 0, j, 0, 8});
    for (uint32_t i = 0; i < 8; ++i)
      values.push_back(5 + 3 * i + 100 * static_cast<uint32_t>(j) + i * static_cast<uint32_t>(j));
  }
  const std::vector<Row> rows = rowsOf(runs, values.size());
  const auto misses = [&](Predictor predictor) {
    size_t count = 0;
    predictRows(predictor, rows, values.data(), [&](uint32_t n, uint32_t predicted) {
      count += predicted != values[n];
      return values[n];
    });
    return count;
  };
  EXPECT_EQ(misses(Predictor::kNone), 48u);
  EXPECT_EQ(misses(Predictor::kLinear), 12u);        // each row's first two
  EXPECT_EQ(misses(Predictor::kAbove), 2 + 5 * 8u);  // the slope along i is another in each row
  EXPECT_EQ(misses(Predictor::kAboveLinear), 2 + 5 * 2u);
}

TEST(Predictor, WrapsAround) {
  std::mt19937 random(1);
  std::vector<NodeRun> runs;
  for (uint64_t j = 0; j < 10; ++j) runs.push_back({0, j % 3, j, 0, 10});
  std::vector<uint32_t> values(100);
  for (uint32_t& value : values) value = random();
  const std::vector<Row> rows = rowsOf(runs, 100);
  for (int p = 0; p < kPredictors; ++p) {
    std::vector<uint32_t> coded(100);
    predictRows(static_cast<Predictor>(p), rows, values.data(), [&](uint32_t n, uint32_t predicted) {
      coded[n] = unzigzag(zigzag(values[n] - predicted));
      return values[n];
    });
    predictRows(static_cast<Predictor>(p), rows, coded.data(),
                [&](uint32_t n, uint32_t predicted) { return coded[n] += predicted; });
    EXPECT_EQ(coded, values) << p;
  }
}

TEST(Predictor, OfKnownValuesLeavesTheSame) {
  std::mt19937 random(2);
  for (int round = 0; round < 200; ++round) {
    // Rows of any length, some below one another; values of any width, 0 and 32 bits among them.
    std::vector<Row> rows;
    std::vector<uint32_t> values;
    const auto shift = static_cast<int>(random() % 33);
    for (int r = 0; r < 8; ++r) {
      const auto first = static_cast<uint32_t>(values.size());
      Row row{first, 1 + static_cast<uint32_t>(random() % 60), kNoRow};
      if (first > 0 && random() % 3 != 0) {
        row.above = static_cast<uint32_t>(random() % first);
        row.count = std::min(row.count, first - row.above);
      }
      rows.push_back(row);
      for (uint32_t n = 0; n < row.count; ++n)
        values.push_back(static_cast<uint32_t>(uint64_t{random()} >> shift));
    }
    PredictorChoice best{Predictor::kNone, UINT64_MAX};
    for (int p = 0; p < kPredictors; ++p) {
      const auto predictor = static_cast<Predictor>(p);
      std::vector<uint32_t> expected(values.size()), found(values.size(), 1);
      uint64_t bits = 0;
      predictRows(predictor, rows, values.data(), [&](uint32_t n, uint32_t predicted) {
        expected[n] = zigzag(values[n] - predicted);
        bits += static_cast<uint64_t>(std::bit_width(expected[n]));
        return values[n];
      });
      residualsOf(predictor, rows, values.data(), found.data());
      EXPECT_EQ(found, expected) << p;
      if (bits < best.bits) best = {predictor, bits};
    }
    const PredictorChoice choice = bestPredictor(rows, values);
    EXPECT_EQ(choice.predictor, best.predictor);
    EXPECT_EQ(choice.bits, best.bits);
  }
}

TEST(Planes, RoundTrip) {
  PlaneWriter writer;
  const std::vector<uint32_t> none(50, 0), one(50, 255), two(50, 256), four(50, 0xfedcba98);
  EXPECT_EQ(writer.add(none), 0);
  EXPECT_EQ(writer.add(one), 1);
  EXPECT_EQ(writer.add(two), 2);
  EXPECT_EQ(writer.add(four), 4);
  const std::vector<std::byte> frame = writer.compress({});
  PlaneReader reader(frame, 50 * 7);
  std::vector<uint32_t> back(50);
  reader.values(0, back);
  EXPECT_EQ(back, none);
  reader.values(1, back);
  EXPECT_EQ(back, one);
  reader.values(2, back);
  EXPECT_EQ(back, two);
  reader.values(4, back);
  EXPECT_EQ(back, four);
  EXPECT_THROW(reader.values(1, back), Error);
  EXPECT_THROW(PlaneReader(frame, 50 * 7 + 1), Error);
  EXPECT_THROW(PlaneReader(frame, 50 * 7 - 1), Error);
}

TEST(Varint, RoundTripsAndRefuses) {
  for (const uint64_t value : {uint64_t{0}, uint64_t{127}, uint64_t{128}, uint64_t{1} << 63, ~uint64_t{0}}) {
    std::vector<std::byte> bytes;
    appendVarint(bytes, value);
    std::span<const std::byte> rest(bytes);
    EXPECT_EQ(takeVarint(rest), value);
    EXPECT_TRUE(rest.empty());
    for (size_t length = 0; length < bytes.size(); ++length) {
      std::span<const std::byte> prefix = std::span(bytes).first(length);
      EXPECT_THROW(takeVarint(prefix), Error);
    }
  }
  const std::vector<std::byte> endless(20, std::byte{0xff});
  std::span<const std::byte> rest(endless);
  EXPECT_THROW(takeVarint(rest), Error);
}

/// A values stream of `count` values whose rows are `rows`, as no encoder would write them.
std::vector<std::byte> valuesWithRows(uint32_t count, const std::vector<uint64_t>& rows) {
  PlaneWriter planes;
  std::vector<std::byte> bytes;
  for (const uint64_t number : rows) appendVarint(bytes, number);
  planes.addBytes(bytes);
  ValuesHeader header{};
  header.upper = 1;
  header.rows_bytes = static_cast<uint32_t>(bytes.size());
  const std::vector<uint32_t> ones(count, 1);
  for (ArrayCode& array : header.arrays) array = {Predictor::kAboveLinear, planes.add(ones)};
  return planes.compress(std::as_bytes(std::span(&header, 1)));
}

TEST(Values, RefuseInvalidRows) {
  SplatVariable values;
  values.resize(8);
  const VariableArrays<float> out = arraysOf(values);
  EXPECT_NO_THROW(decodeValuesStream(8, valuesWithRows(8, {4, 0, 4, 4}), out));
  EXPECT_NO_THROW(decodeValuesStream(8, valuesWithRows(8, {2, 0, 6, 1}), out));  // odd, and harmless
  for (const std::vector<uint64_t>& rows : std::vector<std::vector<uint64_t>>{{4, 0, 4, 5},
                                                                              {4, 1, 4, 0},
                                                                              {4, 0},
                                                                              {4, 0, 5, 0},
                                                                              {0, 0, 8, 0},
                                                                              {~uint64_t{0}, 0},
                                                                              {4, 0, 4, ~uint64_t{0}},
                                                                              {4, 0, 4}})
    EXPECT_THROW(decodeValuesStream(8, valuesWithRows(8, rows), out), Error);
}

/// Decoding either throws an Error, or gives what the interface promises.
void expectSafe(const RootCube& root, const EncodedBrick& encoded, std::span<const std::byte> geometry,
                std::span<const std::byte> values) {
  // In allocations of exactly their size, so that reading beyond them is seen by a sanitizer.
  const std::vector<std::byte> exact_geometry(geometry.begin(), geometry.end());
  const std::vector<std::byte> exact_values(values.begin(), values.end());
  try {
    SplatGeometry out;
    std::vector<NodeRun> runs;
    decodeGeometry(root, encoded.brick, exact_geometry, out, &runs);
    ASSERT_EQ(out.size(), encoded.brick.splats);
    const auto size = static_cast<float>(root.cellSize(encoded.brick.cell.level));
    for (size_t n = 0; n < out.size(); ++n) {
      ASSERT_TRUE(out.x[n] >= 0 && out.x[n] < size && out.y[n] >= 0 && out.y[n] < size && out.z[n] >= 0 &&
                  out.z[n] < size);
      ASSERT_TRUE(out.axis0[n] > 0 && out.axis1[n] > 0 && out.axis2[n] > 0 && out.weight[n] >= 0);
      ASSERT_TRUE(std::isfinite(out.axis0[n] + out.axis1[n] + out.axis2[n] + out.weight[n]));
      ASSERT_TRUE(std::isfinite(out.shear10[n]) && std::isfinite(out.shear20[n]) &&
                  std::isfinite(out.shear21[n]));
    }
  } catch (const Error&) {
  }
  try {
    SplatVariable out;
    decodeVariable(encoded.brick, encoded.variables[0], exact_values, out);
    ASSERT_EQ(out.size(), encoded.brick.splats);
    for (size_t n = 0; n < out.size(); ++n)
      ASSERT_TRUE(std::isfinite(out.mean[n]) && std::isfinite(out.slope0[n]) &&
                  std::isfinite(out.slope1[n]) && std::isfinite(out.slope2[n]) &&
                  std::isfinite(out.variance[n]) && out.variance[n] >= 0);
  } catch (const Error&) {
  }
}

TEST(DamagedBrick, SurvivesTruncatedBytes) {
  RandomBrick like;
  like.splats = 40;
  BrickSplats brick = randomBrick(like, Cell{}, 8);
  const EncodedBrick encoded = encodeBrick(RootCube{}, brick);
  SplatGeometry geometry;
  SplatVariable values;
  for (size_t length = 0; length < encoded.geometry.size(); ++length)
    ASSERT_THROW(
        decodeGeometry(RootCube{}, encoded.brick, std::span(encoded.geometry).first(length), geometry),
        Error);
  for (size_t length = 0; length < encoded.values[0].size(); ++length)
    ASSERT_THROW(decodeVariable(encoded.brick, encoded.variables[0],
                                std::span(encoded.values[0]).first(length), values),
                 Error);
}

TEST(DamagedBrick, SurvivesFlippedBits) {
  for (const size_t splats : {1u, 40u, 3000u}) {
    RandomBrick like;
    like.splats = splats;
    BrickSplats brick = randomBrick(like, Cell{}, 9);
    const EncodedBrick encoded = encodeBrick(RootCube{}, brick);
    std::vector<std::byte> geometry = encoded.geometry, values = encoded.values[0];
    const size_t bits = 8 * std::max(geometry.size(), values.size());
    // Every bit of the headers and of small bricks, some of the others.
    for (size_t bit = 0; bit < bits; bit += bit < 4000 ? 1 : 997) {
      const auto flip = [bit](std::vector<std::byte>& bytes) {
        if (bit / 8 < bytes.size()) bytes[bit / 8] ^= std::byte{1} << bit % 8;
      };
      flip(geometry), flip(values);
      expectSafe(RootCube{}, encoded, geometry, values);
      flip(geometry), flip(values);
    }
  }
}

TEST(DamagedBrick, RefusesAWrongCount) {
  BrickSplats brick = randomBrick({}, Cell{}, 10);
  const EncodedBrick encoded = encodeBrick(RootCube{}, brick);
  SplatGeometry geometry;
  for (const uint32_t splats : {0u, 1u, 999u, 1001u, kMaxBrickSplats, 1u << 31}) {
    Brick other = encoded.brick;
    other.splats = splats;
    EXPECT_THROW(decodeGeometry(RootCube{}, other, encoded.geometry, geometry), Error) << splats;
  }
}

}  // namespace
}  // namespace curvisplat
