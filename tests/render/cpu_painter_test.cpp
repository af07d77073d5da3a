#include "render/cpu_painter.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <cmath>
#include <random>
#include <vector>

#include "render/kernel.h"
#include "render/tile.h"
#include "tests/support/splat_compositor.h"

namespace curvisplat {
namespace {

constexpr glm::vec4 kWhite{1, 1, 1, 1};

/// Colours and extinction that change with the scalar, and a jump.
ClassificationTable lively(bool log_scale = false) {
  return {
      [](double f) {
        return TransferFunction::Value{{f, 0.5 + 0.5 * std::sin(9 * f), 1 - f}, f > 0.6 ? 8.0 : 2 * f * f};
      },
      log_scale ? 0.01 : 0.0, 1.0, log_scale};
}

/// Without a jump: straight lines fit.
ClassificationTable smooth(bool log_scale = false) {
  return {[](double f) {
            return TransferFunction::Value{{f, 0.5 + 0.5 * std::sin(4 * f), 1 - f}, 2 * f};
          },
          log_scale ? 0.01 : 0.0, 1.0, log_scale};
}

/// Round, lean and thin ones, of which some lie outside of the image and some are larger than it.
std::vector<ScreenSplat> randomSplats(int count, uint32_t seed, ImageSize size, float slope = 0.3f,
                                      float opacity = 0.5f) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  const auto width = static_cast<float>(size.width), height = static_cast<float>(size.height);
  std::vector<ScreenSplat> splats;
  for (int n = 0; n < count; ++n) {
    float l11 = 1.3f + 12 * unit(random) * unit(random), l22 = 1.3f + 3 * unit(random);
    float l21 = 3 * l11 * around(random);
    if (n % 29 == 0) l11 *= 20, l22 *= 20, l21 *= 20;
    if (n % 31 == 0) l11 = 0.1f, l21 = 0.3f * around(random), l22 = 0.2f;
    splats.push_back({width * (1.4f * unit(random) - 0.2f), height * (1.4f * unit(random) - 0.2f), l11, l21,
                      l22, opacity * unit(random), 1.4f * unit(random) - 0.2f, slope * around(random),
                      slope * around(random), 0.2f * unit(random)});
  }
  return splats;
}

Image paint(std::span<const ScreenSplat> splats, const ClassificationTable& table, bool per_pixel,
            ImageSize size, const glm::vec4& background = kWhite, const PaintResources& resources = {}) {
  CpuPainter painter;
  painter.begin(size, background, table, per_pixel, resources);
  painter.draw(splats);
  return painter.end();
}

double largestDifference(const Image& a, const Image& b) {
  double largest = 0;
  for (size_t n = 0; n < a.rgba.size(); ++n) {
    EXPECT_TRUE(std::isfinite(a.rgba[n]));
    largest = std::max<double>(largest, std::abs(a.rgba[n] - b.rgba[n]));
  }
  return largest;
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
          const auto splats = randomSplats(200, 7, size);
          const Image drawn = paint(splats, table, per_pixel, size, background);
          const Image specified = compositeSplats(splats, table, per_pixel, size, background);
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
                                compositeSplats(splats, smooth(), per_pixel, size, kWhite)),
              2e-3);
  }
}

TEST_P(OnEveryTarget, KeepsVeryThinSplats) {
  // Many layers whose optical depth a float next to 1 hardly tells from nothing.
  const ClassificationTable table([](double) { return TransferFunction::Value{glm::dvec3(0.0), 1}; }, 0, 1);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> amplitude(1e-5f, 3e-5f);
  std::vector<ScreenSplat> splats;
  double depth = 0;
  for (int layer = 0; layer < 50000; ++layer) {
    splats.push_back({2.5f, 2.5f, 1e4f, 0, 1e4f, amplitude(random), 0.5f, 0, 0, 0});
    depth += splats.back().amplitude * footprint(0);
  }
  const Image image = paint(splats, table, true, {5, 5});
  EXPECT_NEAR(image.pixel(2, 2)[0], std::exp(-depth), 2e-4);
}

TEST_P(OnEveryTarget, IsTheSameForAnyThreadsAndBatches) {
  const ImageSize size{200, 130};
  const auto splats = randomSplats(3000, 3, size);
  const Image first = paint(splats, lively(), true, size);
  for (const unsigned threads : {1u, 2u, 3u, 8u})
    for (const size_t batch : {size_t{1}, size_t{100}, size_t{1024}, size_t{65536}})
      EXPECT_EQ(paint(splats, lively(), true, size, kWhite, {threads, batch}).rgba, first.rgba)
          << threads << " threads, batches of " << batch;
}

// Bit for bit where multiply-adds are fused, and where they are not; between the two to their rounding.
TEST(CpuPainter, EveryTargetDrawsTheSame) {
  const ImageSize size{150, 90};
  const auto splats = randomSplats(1000, 13, size);
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
      EXPECT_LT(largestDifference(fused[0], separate[0]), 1e-4);
    }
  }
}

TEST(CpuPainter, LeavesUntouchedPixelsAlone) {
  const ScreenSplat splat{40, 40, 3, 2, 3, 1, 0.9f, 0.1f, 0.1f, 0.1f};
  const Image image = paint({&splat, 1}, lively(), true, {100, 100}, {0.3f, 0.1f, 0.7f, 0.9f});
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 100; ++x) {
      const double u0 = (x + 0.5 - 40) / 3, u1 = (y + 0.5 - 40 - 2 * u0) / 3;
      EXPECT_EQ(image.pixel(x, y)[0] == 0.3f, std::hypot(u0, u1) >= kKernelSupport) << x << ' ' << y;
    }
}

TEST(CpuPainter, BlendsLaterSplatsOverEarlierOnes) {
  const ClassificationTable table(
      [](double f) {
        return TransferFunction::Value{{f > 0.5, 0, f < 0.5}, 100};
      },
      0, 1);
  const std::vector<ScreenSplat> splats{{10, 10, 4, 0, 4, 1, 0.2f, 0, 0, 0},
                                        {10, 10, 4, 0, 4, 1, 0.8f, 0, 0, 0}};
  const Image image = paint(splats, table, true, {20, 20});
  EXPECT_NEAR(image.pixel(10, 10)[0], 1, 1e-5);
  EXPECT_NEAR(image.pixel(10, 10)[2], 0, 1e-5);
}

TEST(CpuPainter, DrawsFrameAfterFrame) {
  const auto splats = randomSplats(100, 5, {64, 64});
  const auto table = lively();
  CpuPainter painter;
  std::vector<Image> images;
  for (const int side : {64, 32, 64}) {
    painter.begin({side, side}, kWhite, table, true);
    painter.draw(splats);
    images.push_back(painter.end());
  }
  EXPECT_EQ(images[0].rgba, images[2].rgba);
  EXPECT_EQ(images[1].size.width, 32);
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

}  // namespace
}  // namespace curvisplat
