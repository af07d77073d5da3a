#include "tools/throughput/brick_sample.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace curvisplat {
namespace {

struct Bricks {
  explicit Bricks(size_t count, uint32_t least, uint32_t most) {
    std::mt19937 random(1);
    for (size_t n = 0; n < count; ++n) {
      bricks.emplace_back().splats = least + static_cast<uint32_t>(random() % (most - least + 1));
      parts.push_back({static_cast<uint32_t>(n)});
      splats += bricks.back().splats;
    }
  }
  std::vector<Brick> bricks;
  std::vector<BrickPart> parts;
  uint64_t splats = 0;
};

TEST(BrickSample, IsAllOfASmallFrame) {
  const Bricks frame(10, 5, 9);
  const BrickSample sample = sampleOf(frame.parts, frame.bricks, frame.splats);
  EXPECT_EQ(sample.parts, frame.parts);
  EXPECT_EQ(sample.splats, frame.splats);
  EXPECT_TRUE(sampleOf({}, {}, 100).parts.empty());
}

TEST(BrickSample, IsAFewRunsSpreadOverALargeOne) {
  const Bricks frame(5000, 500, 1500);
  constexpr uint64_t kWanted = 400'000;
  const BrickSample sample = sampleOf(frame.parts, frame.bricks, kWanted, 8);
  uint64_t splats = 0;
  size_t runs = 0;
  for (size_t n = 0; n < sample.parts.size(); ++n) {
    splats += frame.bricks[sample.parts[n].brick].splats;
    if (n == 0 || sample.parts[n].brick != sample.parts[n - 1].brick + 1) ++runs;
    if (n > 0) {
      EXPECT_GT(sample.parts[n].brick, sample.parts[n - 1].brick);
    }
  }
  EXPECT_EQ(sample.splats, splats);
  EXPECT_EQ(runs, 8u);
  // Each run may go over its share by one brick.
  EXPECT_GE(splats, kWanted);
  EXPECT_LE(splats, kWanted + 8 * 1500);
  // One run an eighth of the frame.
  for (size_t eighth = 0; eighth < 8; ++eighth)
    EXPECT_TRUE(std::any_of(sample.parts.begin(), sample.parts.end(), [&](const BrickPart& part) {
      return part.brick >= eighth * 600 && part.brick < (eighth + 1) * 640;
    })) << eighth;
}

TEST(BrickSample, HasOnePartAtLeast) {
  const Bricks frame(3, 1000, 1000);
  const BrickSample sample = sampleOf(frame.parts, frame.bricks, 10);
  ASSERT_GE(sample.parts.size(), 1u);
  EXPECT_EQ(sample.parts.front().brick, 0u);
}

TEST(BrickSample, CountsTheOctantsThatAreDrawn) {
  Bricks frame(1, 80, 80);
  frame.bricks[0].octant_splats.fill(10);
  frame.parts[0].octants = 0b101;
  EXPECT_EQ(sampleOf(frame.parts, frame.bricks, 1000).splats, 20u);
}

}  // namespace
}  // namespace curvisplat
