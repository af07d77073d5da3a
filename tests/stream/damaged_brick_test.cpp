// What the codec does with bytes that are truncated, changed or hostile.
#include <gtest/gtest.h>

#include <cmath>

#include "stream/base/error.h"
#include "stream/codec/brick_codec.h"
#include "tests/stream/test_bricks.h"

namespace curvisplat {
namespace {

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
