#include "render/cpu/cpu_painter.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stop_token>
#include <vector>

#include "render/cpu/tile.h"
#include "render/project/footprint.h"
#include "render/project/tile_set.h"
#include "tests/reference/splat_compositor.h"

namespace curvisplat {
namespace {

constexpr glm::vec4 kWhiteBackground{1, 1, 1, 1};

/// Farthest first.
Image paint(std::span<const ScreenSplat> splats, const ClassificationTable& table, bool per_pixel,
            ImageSize size, const glm::vec4& background = kWhiteBackground,
            const PaintResources& resources = {}) {
  CpuPainter painter;
  return paintFrame(painter, splats, table, {per_pixel}, {size, background}, resources);
}

/// Every instruction set that this processor has and this program was built for, one after the other.
class OnEveryTarget : public testing::TestWithParam<int64_t> {
 protected:
  void SetUp() override { hwy::SetSupportedTargetsForTest(GetParam()); }
  void TearDown() override { hwy::SetSupportedTargetsForTest(0); }
};

std::string targetName(const testing::TestParamInfo<int64_t>& info) {
  return hwy::TargetName(info.param);
}

INSTANTIATE_TEST_SUITE_P(CpuPainter, OnEveryTarget, testing::ValuesIn(CpuPainter::targets()), targetName);

TEST_P(OnEveryTarget, DrawsRandomSplatsAsSpecified) {
  const glm::vec4 background(0.1f, 0.2f, 0.05f, 0.3f);
  for (const ImageSize size : {ImageSize{70, 50}, ImageSize{1, 1}, ImageSize{32, 64}, ImageSize{33, 3}})
    for (const bool per_pixel : {true, false})
      for (const bool log_scale : {true, false})
        for (const auto& table : {lively(log_scale), smooth(log_scale)}) {
          const auto splats = cutSome(randomSplats(200, 7, size), 3);
          const Image drawn = paint(splats, table, per_pixel, size, background);
          const Image specified = compositeSplats(splats, table, {per_pixel}, size, background);
          EXPECT_LT(largestDifference(drawn, specified), 2e-3)
              << size.width << 'x' << size.height << " per pixel: " << per_pixel << " log: " << log_scale;
          EXPECT_GT(compareImages(drawn, specified).psnr_db, 70)
              << size.width << 'x' << size.height << " per pixel: " << per_pixel << " log: " << log_scale;
        }
}

TEST_P(OnEveryTarget, DrawsOpaqueSplatsAsSpecified) {
  const ImageSize size{40, 40};
  for (const bool per_pixel : {true, false}) {
    const auto splats = randomSplats(60, 11, size, 0.3f, 100);
    EXPECT_LT(largestDifference(paint(splats, smooth(), per_pixel, size),
                                compositeSplats(splats, smooth(), {per_pixel}, size, kWhiteBackground)),
              2e-3);
  }
}

// Parabolas may end below zero there by a rounding error, which is no optical depth.
TEST_P(OnEveryTarget, IsRightWhereExtinctionEnds) {
  const ImageSize size{80, 80};
  const ClassificationTable ramp(
      [](double f) {
        return TransferFunction::Value{{f, 1 - f, 0.5}, 40 * std::max(0.0, f - 0.3)};
      },
      0, 1);
  for (const float slope : {0.01f, 0.1f}) {
    const auto splats = randomSplats(400, 17, size, slope, 5);
    EXPECT_LT(largestDifference(paint(splats, ramp, true, size),
                                compositeSplats(splats, ramp, {}, size, kWhiteBackground)),
              4e-3);
  }
}

TEST_P(OnEveryTarget, IsTheSameForAnyThreadsAndBatches) {
  const ImageSize size{200, 130};
  for (const float opacity : {0.5f, 50.0f}) {  // much of the latter is hidden
    const auto splats = cutSome(randomSplats(3000, 3, size, 0.3f, opacity), 1);
    const Image first = paint(splats, lively(), true, size);
    for (const unsigned threads : {1u, 2u, 3u, 8u})
      for (const size_t batch : {size_t{1}, size_t{100}, size_t{1024}, size_t{65536}})
        EXPECT_EQ(paint(splats, lively(), true, size, kWhiteBackground, {threads, batch}).rgba, first.rgba)
            << threads << " threads, batches of " << batch << ", opacity " << opacity;
  }
}

// Ranks that draw a picture together share tiles: no pixel's bits depend on whether others are drawn.
TEST_P(OnEveryTarget, DrawsPartsOfTilesAsTheWhole) {
  const ImageSize size{70, 50};
  const int columns = TileSet::tilesAlong(size.width, kSharedTileSide);
  const auto table = lively();
  for (const float opacity : {0.5f, 50.0f}) {
    auto splats = cutSome(randomSplats(3000, 3, size, 0.3f, opacity), 1);
    const Image whole = paint(splats, table, true, size);
    std::reverse(splats.begin(), splats.end());
    for (int border = 1; border < columns; ++border) {
      std::vector<uint32_t> owners(TileSet::tilesOf(size, kSharedTileSide));
      for (size_t tile = 0; tile < owners.size(); ++tile)
        owners[tile] = static_cast<int>(tile) % columns >= border;
      for (const uint32_t owner : {0u, 1u}) {
        const TileSet tiles(size, owners, owner);
        CpuPainter painter;
        painter.begin(size, kWhiteBackground, table, {true});
        painter.drawOnly(tiles);
        painter.draw(splats);
        const Image part = painter.end();
        size_t different = 0;
        for (int y = 0; y < size.height; ++y)
          for (int x = 0; x < size.width; ++x)
            different += tiles.hasPixel(x, y) &&
                         !std::equal(part.pixel(x, y), part.pixel(x, y) + 4, whole.pixel(x, y));
        EXPECT_EQ(different, 0u) << opacity << ", border " << border << ", owner " << owner;
      }
    }
  }
}

// Bit for bit where multiply-adds are fused, and where they are not; between the two to their rounding, by
// which a block may be saturated a splat earlier.
TEST(CpuPainter, EveryTargetDrawsTheSame) {
  const ImageSize size{150, 90};
  const auto splats = cutSome(randomSplats(1000, 13, size), 2);
  for (const bool per_pixel : {true, false}) {
    std::vector<Image> fused, separate;
    for (const int64_t target : CpuPainter::targets()) {
      hwy::SetSupportedTargetsForTest(target);
      auto& images = CpuPainter::fuses(target) ? fused : separate;
      images.push_back(paint(splats, lively(), per_pixel, size));
      hwy::SetSupportedTargetsForTest(0);
      EXPECT_EQ(images.back().rgba, images.front().rgba) << hwy::TargetName(target);
    }
    if (!fused.empty() && !separate.empty()) {
      EXPECT_LT(largestDifference(fused[0], separate[0]), 1e-4 + kSaturated);
    }
  }
}

TEST(CpuPainter, LeavesUntouchedPixelsAlone) {
  const ScreenSplat splat{40, 40, 3, 2, 3, 1, 0.9f, 0.1f, 0.1f, 0.1f, 0, 0, 0, 0, 0, 0};
  const Image image = paint({&splat, 1}, lively(), true, {100, 100}, {0.3f, 0.1f, 0.7f, 0.9f});
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 100; ++x) {
      const double u0 = (x + 0.5 - 40) / 3, u1 = (y + 0.5 - 40 - 2 * u0) / 3;
      EXPECT_EQ(image.pixel(x, y)[0] == 0.3f, std::hypot(u0, u1) >= kKernelSupport) << x << ' ' << y;
    }
}

// The bounds that tile.h promises of constants, parabolas and lines, one splat after the other: optical depths are
// read off the alpha of a frame without a background.
TEST_P(OnEveryTarget, FitsKeepTheirBound) {
  const ImageSize size{32, 32};  // a tile
  double largest = 0;            // in what is allowed
  for (const bool log_scale : {false, true})
    for (const auto& table : {smooth(log_scale), lively(log_scale)})
      for (const float slope : {0.002f, 0.01f, 0.05f, 0.3f}) {
        for (ScreenSplat splat : randomSplats(60, 23, size, slope, 0.1f)) {
          splat.half_width *= slope;
          const Image image = paint({&splat, 1}, table, true, size, glm::vec4(0));
          double most = 0;                                // extinction
          std::vector<std::pair<double, double>> depths;  // geometric and optical
          for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x) {
              const double u0 = (x + 0.5 - splat.x) / splat.l11;
              const double u1 = (y + 0.5 - splat.y - splat.l21 * u0) / splat.l22;
              const double skew = FootprintSkew::unpack(splat.skew).at(u0, u1);
              const double depth = splat.amplitude * footprint(std::hypot(u0, u1)) * skew;
              const double extinction =
                  table
                      .mean(splat.mean + double{splat.slope0} * u0 + double{splat.slope1} * u1,
                            splat.half_width)
                      .w;
              if (depth > 0) most = std::max(most, extinction);
              depths.emplace_back(depth, depth * extinction);
            }
          const double peak = splat.amplitude * footprint(0);
          for (size_t n = 0; n < depths.size(); ++n) {
            const auto [depth, optical_depth] = depths[n];
            const double off = std::abs(-std::log1p(-double{image.rgba[4 * n + 3]}) - optical_depth);
            // The footprint's own error, and that of a float near 1.
            const double rounding = 4e-4 * splat.amplitude * most + 1e-6;
            const double allowed = depth * std::max(kRelativeError * most, kDepthError / peak);
            largest = std::max(largest, (off - rounding) / (allowed + 1e-9));
          }
        }
      }
  EXPECT_LT(largest, 1);
  EXPECT_GT(largest, 0.01);  // there was something to be measured
  RecordProperty("largest_part_of_the_bound", std::to_string(largest));
}

TEST(CpuPainter, LeavesOutLessThanAFourThousandth) {
  const ImageSize size{64, 64};
  const ClassificationTable table([](double f) { return TransferFunction::Value{glm::dvec3(f), 1}; }, 0, 1);
  // A black layer before what is white and opaque.
  const ScreenSplat behind{32, 32, 1e4f, 0, 1e4f, 100, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  for (const float depth : {8.0f, 8.31f, 8.325f, 9.0f}) {  // log 4096 = 8.318
    const auto amplitude = static_cast<float>(depth / footprint(0));
    const std::vector<ScreenSplat> splats{behind,
                                          {32, 32, 1e4f, 0, 1e4f, amplitude, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}};
    const glm::vec4 black(0, 0, 0, 1);
    const Image image = paint(splats, table, false, size, black);
    const Image layer_alone = paint({&splats[1], 1}, table, false, size, black);
    const float seen = image.pixel(30, 30)[0] - layer_alone.pixel(30, 30)[0];
    if (std::exp(-depth) < kSaturated)
      EXPECT_EQ(seen, 0) << depth;
    else
      EXPECT_NEAR(seen, std::exp(-depth), 1e-5) << depth;
  }
}

TEST(CpuPainter, DrawsNothingBehindWhatIsOpaque) {
  const ImageSize size{150, 100};
  const auto far = randomSplats(2000, 3, size, 0.3f, 100);
  const ScreenSplat wall{75, 50, 1e4f, 0, 1e4f, 1000, 0.9f, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  auto splats = far;
  splats.push_back(wall);
  CpuPainter painter;
  const Image image = paintFrame(painter, splats, lively(), {}, {size, kWhiteBackground}, {2, 100});
  EXPECT_EQ(image.rgba, paint({&wall, 1}, lively(), true, size).rgba);
  EXPECT_GE(painter.hiddenSplats(), 1900u);
  EXPECT_LE(painter.hiddenSplats(), 2000u);
}

TEST(CpuPainter, HidesWhatIsBehindOpaqueBlocks) {
  const ImageSize size{150, 101};
  const auto table = lively();
  CpuPainter painter;
  painter.begin(size, kWhiteBackground, table, {}, {2, 1});  // batches of one splat
  EXPECT_FALSE(painter.hides({0, 0, 150, 101}));
  EXPECT_TRUE(painter.hides({-20, 5, -1, 9}));  // what is outside of the image
  EXPECT_TRUE(painter.hides({150, 5, 1e30f, 9}));
  EXPECT_FALSE(painter.hides({NAN, 5, 160, 9}));
  const std::vector<ScreenSplat> splats{{60, 60, 20, 0, 20, 1000, 0.9f, 0, 0, 0, 0, 0, 0, 0, 0, 0},
                                        {60, 60, 1, 0, 1, 1, 0.9f, 0, 0, 0, 0, 0, 0, 0, 0, 0}};
  painter.draw(splats);
  EXPECT_TRUE(painter.hides({55, 55, 65, 65}));
  EXPECT_TRUE(painter.hides({45, 45, 75, 75}));  // four tiles
  EXPECT_FALSE(painter.hides({55, 55, 120, 65}));
  EXPECT_FALSE(painter.hides({-INFINITY, -INFINITY, INFINITY, INFINITY}));
  painter.end();
  painter.begin(size, kWhiteBackground, table, {}, {2, 1});
  EXPECT_FALSE(painter.hides({55, 55, 65, 65}));
}

// Splats in boxes that were hidden at some time make no difference in any bit.
TEST(CpuPainter, WhatItHidesCannotBeSeen) {
  const ImageSize size{150, 100};
  const auto table = lively();
  std::mt19937 random(4);
  std::uniform_real_distribution<float> unit(0, 1);
  CpuPainter all, some;
  all.begin(size, kWhiteBackground, table, {}, {2, 64});
  some.begin(size, kWhiteBackground, table, {}, {1, 32});
  int hidden = 0;
  for (const ScreenSplat& splat : randomSplats(6000, 21, size, 0.3f, 20)) {
    const auto reach_x = static_cast<float>(kKernelSupport) * splat.l11;
    const auto reach_y = static_cast<float>(kKernelSupport) * std::hypot(splat.l21, splat.l22);
    const ScreenBox box{splat.x - reach_x, splat.y - reach_y, splat.x + reach_x, splat.y + reach_y};
    all.draw({&splat, 1});
    const bool hides = some.hides(box);
    hidden += hides;
    if (!hides) some.draw({&splat, 1});
  }
  EXPECT_GT(hidden, 500);
  EXPECT_EQ(all.end().rgba, some.end().rgba);
}

TEST(CpuPainter, FootprintIsClose) {
  const float* terms = footprintPolynomial();
  for (int n = 0; n <= 1000; ++n) {
    const double x = n / 1000.0;
    double sum = 0;
    for (int term = kFootprintTerms - 1; term >= 0; --term) sum = sum * x + terms[term];
    EXPECT_NEAR(x * x * sum, footprint(kKernelSupport * std::sqrt(1 - x)), 2e-4) << x;
  }
}

// A window would otherwise wait for the rest of a large batch whenever its camera begins to move.
TEST(CpuPainter, PaintsNothingMoreOnceStopped) {
  const ImageSize size{70, 50};
  const auto table = lively();
  const std::vector<ScreenSplat> splats = randomSplats(200, 7, size);
  for (const bool before_drawing : {true, false}) {
    std::stop_source stopping;
    CpuPainter painter;
    painter.begin(size, kWhiteBackground, table, {}, {.stop = stopping.get_token()});
    if (before_drawing) stopping.request_stop();
    painter.draw(splats);
    stopping.request_stop();  // before end(), which paints what fills no batch
    const Image picture = painter.end();
    EXPECT_EQ(picture.rgba, std::vector<float>(picture.rgba.size(), 1.0f)) << before_drawing;
  }
}

}  // namespace
}  // namespace curvisplat
