#include "render/gl_painter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "render/gl_thread.h"
#include "render/kernel.h"
#include "stream/error.h"
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

std::vector<ScreenSplat> randomSplats(int count, uint32_t seed, float width, float height) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  std::vector<ScreenSplat> splats;
  for (int n = 0; n < count; ++n) {
    const float size = 1.3f + 12 * unit(random) * unit(random);
    splats.push_back({width * (1.2f * unit(random) - 0.1f), height * (1.2f * unit(random) - 0.1f), size,
                      3 * size * around(random), 1.3f + 3 * unit(random), 0.5f * unit(random),
                      1.4f * unit(random) - 0.2f, 0.3f * around(random), 0.3f * around(random),
                      0.2f * unit(random)});
  }
  return splats;
}

class GlPainterTest : public testing::Test {
 protected:
  Image paint(std::span<const ScreenSplat> splats, const ClassificationTable& table, bool per_pixel,
              ImageSize size, const glm::vec4& background = kWhite) {
    Image image;
    gl_.run([&](const GlContext& context) {
      GlPainter painter(context);
      painter.begin(size, background, table, per_pixel);
      painter.draw(splats);
      image = painter.end();
    });
    return image;
  }

  GlThread gl_;
};

TEST_F(GlPainterTest, DrawsOneSplatAsSpecified) {
  const ImageSize size{48, 40};
  const ScreenSplat splat{21.3f, 17.8f, 9.0f, -4.0f, 5.0f, 0.8f, 0.55f, 0.2f, -0.1f, 0.03f};
  const auto table = lively();
  for (const bool per_pixel : {true, false}) {
    const auto difference = compareImages(paint({&splat, 1}, table, per_pixel, size),
                                          compositeSplats({&splat, 1}, table, per_pixel, size, kWhite));
    EXPECT_GT(difference.psnr_db, 90) << "per pixel: " << per_pixel;
  }
}

TEST_F(GlPainterTest, DrawsFromMappedMemoryWithoutCopying) {
  const ImageSize size{160, 120};
  const auto splats = randomSplats(3000, 8, 160, 120);
  const auto table = lively();
  gl_.run([&](const GlContext& context) {
    GlPainter painter(context);
    painter.begin(size, kWhite, table, true);
    painter.draw(splats);
    const Image copied = painter.end();
    for (int repetition = 0; repetition < 2; ++repetition) {
      const std::span<ScreenSplat> mapped = painter.mapSplats(splats.size() + 7);
      ASSERT_EQ(mapped.size(), splats.size() + 7) << painter.drawsUnderWay();
      std::copy(splats.begin(), splats.end(), mapped.begin() + 5);
      painter.begin(size, kWhite, table, true);
      for (size_t begin = 0; begin < splats.size(); begin += 500) {
        painter.draw(mapped.subspan(5 + begin, 500));
        EXPECT_LE(painter.drawsUnderWay(), begin / 500 + 1);
        EXPECT_LT(painter.drawsUnderWay(), 4u);
      }
      EXPECT_EQ(painter.end().rgba, copied.rgba);
      EXPECT_EQ(painter.uploadSeconds(), 0);
      painter.finishDraws();
      EXPECT_EQ(painter.drawsUnderWay(), 0u);
      // What lies elsewhere is copied all the same.
      painter.begin(size, kWhite, table, true);
      painter.draw(splats);
      EXPECT_EQ(painter.end().rgba, copied.rgba);
      EXPECT_GT(painter.uploadSeconds(), 0);
    }
  });
}

TEST_F(GlPainterTest, TopOfTheImageIsTheFirstRow) {
  const ScreenSplat splat{10, 3, 2, 0, 2, 1, 0.9f, 0, 0, 0};
  const Image image = paint({&splat, 1}, lively(), false, {20, 20});
  EXPECT_LT(image.pixel(10, 3)[2], 0.8f);
  EXPECT_EQ(image.pixel(10, 16)[2], 1.0f);
}

TEST_F(GlPainterTest, BlendsLaterSplatsOverEarlierOnes) {
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

TEST_F(GlPainterTest, DrawsRandomSplatsAsSpecified) {
  const ImageSize size{70, 50};
  for (const bool per_pixel : {true, false})
    for (const bool log_scale : {true, false}) {
      const auto splats = randomSplats(300, 7, 70, 50);
      const auto table = lively(log_scale);
      const glm::vec4 background(0.1f, 0.2f, 0.05f, 0.3f);
      const Image drawn = paint(splats, table, per_pixel, size, background);
      const Image specified = compositeSplats(splats, table, per_pixel, size, background);
      const auto difference = compareImages(drawn, specified);
      EXPECT_GT(difference.psnr_db, 70) << "per pixel: " << per_pixel << ", log: " << log_scale;
      for (int n : {0, 1234, 3499})
        EXPECT_NEAR(drawn.rgba[static_cast<size_t>(4 * n + 3)],
                    specified.rgba[static_cast<size_t>(4 * n + 3)], 1e-3);
    }
}

TEST_F(GlPainterTest, KeepsVeryThinSplats) {
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
  EXPECT_NEAR(image.pixel(2, 2)[0], std::exp(-depth), 5e-5);
}

TEST_F(GlPainterTest, DrawsTheSameTwice) {
  const auto splats = randomSplats(5000, 3, 200, 200);
  EXPECT_EQ(paint(splats, lively(), true, {200, 200}).rgba, paint(splats, lively(), true, {200, 200}).rgba);
}

TEST_F(GlPainterTest, DrawsFrameAfterFrame) {
  const auto splats = randomSplats(100, 5, 64, 64);
  const auto table = lively();
  gl_.run([&](const GlContext& context) {
    GlPainter painter(context);
    std::vector<Image> images;
    for (const int side : {64, 32, 64}) {
      painter.begin({side, side}, kWhite, table, true);
      painter.draw(splats);
      images.push_back(painter.end());
    }
    EXPECT_EQ(images[0].rgba, images[2].rgba);
    EXPECT_EQ(images[1].size.width, 32);
  });
}

TEST_F(GlPainterTest, RefusesAnImageBeyondTheLimitAndGoesOn) {
  const auto table = lively();
  gl_.run([&](const GlContext& context) {
    GlPainter painter(context);
    try {
      painter.begin({1 << 20, 8}, kWhite, table, true);
      ADD_FAILURE() << "an image of a million columns was accepted";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("1048576x8"), std::string::npos) << error.what();
    }
    painter.begin({8, 8}, kWhite, table, true);
    EXPECT_EQ(painter.end().pixel(4, 4)[0], 1.0f);
  });
}

TEST(GlThread, HandsErrorsToTheCaller) {
  GlThread gl;
  EXPECT_NE(gl.contextName().find("OpenGL"), std::string::npos) << gl.contextName();
  EXPECT_THROW(gl.run([](const GlContext&) { throw Error("no"); }), Error);
  bool ran = false;
  gl.run([&](const GlContext&) { ran = true; });
  EXPECT_TRUE(ran);
}

}  // namespace
}  // namespace curvisplat
