// Duties of every painter, with each backend that there is; and what those by OpenGL must do beside it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <vector>

#include "render/backend/backend.h"
#include "render/gl/gl_context.h"
#include "render/gl/gl_painter.h"
#include "render/gl/gl_tile_lists.h"
#include "render/gl/gl_tile_painter.h"
#include "render/project/footprint.h"
#include "render/project/painter.h"
#include "render/project/tile_key.h"
#include "stream/base/error.h"
#include "tests/reference/splat_compositor.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

constexpr glm::vec4 kWhite{1, 1, 1, 1};

class PainterTest : public testing::TestWithParam<Backend> {
 protected:
  Image paint(std::span<const ScreenSplat> splats, const ClassificationTable& table, bool per_pixel,
              ImageSize size, const glm::vec4& background = kWhite, bool lit = false) {
    return paint(splats, table, PixelShading{per_pixel, lit}, size, background);
  }
  Image paint(std::span<const ScreenSplat> splats, const ClassificationTable& table,
              const PixelShading& shading, ImageSize size, const glm::vec4& background) {
    Image image;
    backend_->run([&](Painter& painter) {
      image = paintFrame(painter, splats, table, shading, {size, background});
    });
    return image;
  }

  const std::unique_ptr<PaintingBackend> backend_ = makeBackend(GetParam());
  const ClassificationTable lively_ = lively();
};

INSTANTIATE_TEST_SUITE_P(Painters, PainterTest,
                         testing::Values(Backend::kCpu, Backend::kOsmesa, Backend::kEgl),
                         [](const auto& with) {
                           return with.param == Backend::kCpu      ? "Cpu"
                                  : with.param == Backend::kOsmesa ? "OsMesa"
                                                                   : "Egl";
                         });

TEST_P(PainterTest, DrawsOneSplatAsSpecified) {
  const ImageSize size{48, 40};
  const ScreenSplat splat{21.3f, 17.8f, 9.0f, -4.0f, 5.0f, 0.8f, 0.55f, 0.2f, -0.1f, 0.03f, 0, 0, 0, 0, 0, 0};
  for (const bool per_pixel : {true, false}) {
    const auto difference = compareImages(paint({&splat, 1}, lively(), per_pixel, size),
                                          compositeSplats({&splat, 1}, lively(), {per_pixel}, size, kWhite));
    EXPECT_GT(difference.psnr_db, 85) << "per pixel: " << per_pixel;
  }
}

TEST_P(PainterTest, DrawsRandomSplatsAsSpecified) {
  const ImageSize size{70, 50};
  const glm::vec4 background(0.1f, 0.2f, 0.05f, 0.3f);
  const auto splats = randomSplats(300, 7, size);
  for (const bool per_pixel : {true, false})
    for (const bool log_scale : {true, false})
      for (const auto& table : {lively(log_scale), smooth(log_scale)}) {
        const Image drawn = paint(splats, table, per_pixel, size, background);
        const Image specified = compositeSplats(splats, table, {per_pixel}, size, background);
        EXPECT_GT(compareImages(drawn, specified).psnr_db, 70)
            << "per pixel: " << per_pixel << ", log: " << log_scale;
        for (const int n : {0, 1234, 3499}) {
          const auto alpha = static_cast<size_t>(4 * n + 3);
          EXPECT_NEAR(drawn.rgba[alpha], specified.rgba[alpha], 1e-3);
        }
      }
}

TEST_P(PainterTest, CutsSplatsAsSpecified) {
  const ImageSize size{70, 50};
  const auto splats = cutSome(randomSplats(300, 9, size), 4);
  for (const bool per_pixel : {true, false})
    for (const auto& table : {lively(), smooth(true)}) {
      const Image drawn = paint(splats, table, per_pixel, size);
      const Image specified = compositeSplats(splats, table, {per_pixel}, size, kWhite);
      EXPECT_GT(compareImages(drawn, specified).psnr_db, 70) << "per pixel: " << per_pixel;
      EXPECT_LT(largestDifference(drawn, specified), 4e-3) << "per pixel: " << per_pixel;
    }
}

TEST_P(PainterTest, CutsSplatsAtLayersAsSpecified) {
  const ImageSize size{70, 50};
  const PixelLayers layers = randomLayers(size, 3);
  ASSERT_EQ(layers.windows(), 5);
  const auto splats = placeSome(cutSome(randomSplats(300, 9, size), 4), 5);
  for (const bool per_pixel : {true, false})
    for (const auto& table : {lively(), smooth(true)})
      for (const bool light : {true, false}) {
        const PixelShading shading{per_pixel, light, &layers};
        const auto drawn_splats = light ? lit(splats, 11) : splats;
        const Image drawn = paint(drawn_splats, table, shading, size, {0.1f, 0.2f, 0.05f, 0.3f});
        const Image specified =
            compositeSplats(drawn_splats, table, shading, size, {0.1f, 0.2f, 0.05f, 0.3f});
        EXPECT_GT(compareImages(drawn, specified).psnr_db, 70) << "per pixel: " << per_pixel;
        EXPECT_LT(largestDifference(drawn, specified), 4e-3) << "per pixel: " << per_pixel;
      }
}

TEST_P(PainterTest, DrawsLayersWithoutSplats) {
  const ImageSize size{70, 50};
  const PixelLayers layers = randomLayers(size, 8);
  const PixelShading shading{true, false, &layers};
  EXPECT_LT(largestDifference(paint({}, lively(), shading, size, kWhite),
                              compositeSplats({}, lively(), shading, size, kWhite)),
            1e-6);
  // And none in the next picture.
  EXPECT_EQ(paint({}, lively(), {}, size, kWhite).rgba, paint({}, smooth(), {}, size, kWhite).rgba);
}

TEST_P(PainterTest, LightsSplatsAsSpecified) {
  const ImageSize size{70, 50};
  // Some cut, and some of which every pixel is looked up.
  for (const float slope : {0.05f, 0.3f, 3.0f}) {
    const auto splats = lit(cutSome(randomSplats(300, 9, size, slope), 4), 11);
    for (const bool per_pixel : {true, false})
      for (const auto& table : {lively(), smooth(true)}) {
        const Image drawn = paint(splats, table, per_pixel, size, kWhite, true);
        const Image specified = compositeSplats(splats, table, {per_pixel, true}, size, kWhite);
        EXPECT_GT(compareImages(drawn, specified).psnr_db, 70) << "slope " << slope << ", " << per_pixel;
        const Image unlit = compositeSplats(splats, table, {per_pixel, false}, size, kWhite);
        EXPECT_LT(compareImages(drawn, unlit).psnr_db, 40) << "slope " << slope << ", " << per_pixel;
      }
  }
}

TEST_P(PainterTest, ColoursSplatsByAnotherScalarAsSpecified) {
  const ImageSize size{70, 50};
  const PixelLayers layers = randomLayers(size, 3);
  const glm::vec4 background{0.1f, 0.2f, 0.05f, 0.3f};
  const auto value = [](double f) {
    return TransferFunction::Value{{f, 0.5 + 0.5 * std::sin(12 * f), f > 0.4 ? 1 : 0.2}, 1};
  };
  const ClassificationTable colour_tables[] = {{value, 0, 1}, {value, 0.01, 1, true}};
  for (const float slope : {0.05f, 3.0f})
    for (const bool per_pixel : {true, false})
      for (const bool light : {true, false})
        for (const auto& table : {lively(), smooth(true)})
          for (const bool layered : {true, false}) {
            auto splats = cutSome(randomSplats(120, 9, size, slope), 4);
            if (layered) splats = placeSome(splats, 5);
            splats = colourAll(light ? lit(splats, 11) : splats, 13, slope);
            const PixelShading shading{per_pixel, light, layered ? &layers : nullptr,
                                       &colour_tables[layered ? 1 : 0]};
            const Image drawn = paint(splats, table, shading, size, background);
            const Image specified = compositeSplats(splats, table, shading, size, background);
            EXPECT_GT(compareImages(drawn, specified).psnr_db, 70)
                << "slope " << slope << ", per pixel: " << per_pixel << ", layered: " << layered;
            EXPECT_LT(largestDifference(drawn, specified), 5e-3)
                << "slope " << slope << ", per pixel: " << per_pixel << ", layered: " << layered;
          }
  // And of one scalar in the next picture.
  const auto splats = randomSplats(200, 9, size);
  EXPECT_GT(compareImages(paint(splats, lively(), true, size),
                          compositeSplats(splats, lively(), {true}, size, kWhite))
                .psnr_db,
            70);
}

TEST_P(PainterTest, ShowsNearerSidesAsSpecified) {
  const ImageSize size{70, 50};
  const PixelLayers layers = randomLayers(size, 3);
  for (const bool layered : {true, false})
    for (const bool light : {true, false}) {
      auto splats = hidingSome(cutSome(randomSplats(200, 9, size, 0.05f), 4), 17);
      if (light) splats = lit(splats, 11);
      if (layered) splats = placeSome(splats, 5);
      const PixelShading shading{true, light, layered ? &layers : nullptr};
      const Image drawn = paint(splats, smooth(), shading, size, kWhite);
      const Image specified = compositeSplats(splats, smooth(), shading, size, kWhite);
      for (ScreenSplat& splat : splats) splat.along = 0;
      const Image whole = compositeSplats(splats, smooth(), shading, size, kWhite);
      // Painters leave out what moves a scalar by less than a 250th of the function, and take the extinction of the
      // splat's middle (the processor).
      EXPECT_GT(compareImages(drawn, specified).psnr_db, 55) << layered << ' ' << light;
      EXPECT_LT(compareImages(drawn, whole).psnr_db, 45) << layered << ' ' << light;
    }
}

TEST_P(PainterTest, CutsSplatsWhereverADrawEnds) {
  const ImageSize size{90, 60};
  const PixelLayers layers = randomLayers(size, 3);
  const ClassificationTable colours = smooth();
  for (const bool coloured : {false, true}) {
    const PixelShading shading{true, false, &layers, coloured ? &colours : nullptr};
    auto splats = placeSome(cutSome(randomSplats(200, 21, size), 5), 6);
    if (coloured) splats = colourAll(splats, 8);
    const Image whole = paint(splats, lively(), shading, size, kWhite);
    for (const size_t at_once : {1, 2, 7}) {
      Image image;
      backend_->run([&](Painter& painter) {
        std::vector<ScreenSplat> ordered = splats;
        std::reverse(ordered.begin(), ordered.end());
        painter.begin(size, kWhite, lively_, shading);
        for (size_t begin = 0; begin < ordered.size(); begin += at_once)
          painter.draw(std::span(ordered).subspan(begin, std::min(at_once, ordered.size() - begin)));
        image = painter.end();
      });
      EXPECT_EQ(image.rgba, whole.rgba) << at_once;
    }
  }
}

// A splat of optical depth tau with constant extinction is seen L(tau / 2) = coth(tau / 2) - 2 / tau half
// widths of its depths before its middle: DESIGN.md, "What a splat hides of itself".
TEST_P(PainterTest, ASplatShowsItsNearerSide) {
  const ClassificationTable grey([](double f) { return TransferFunction::Value{{f, f * f, f}, 1}; }, 0, 1);
  for (const float along : {-0.15f, 0.1f})
    for (const float tau : {0.001f, 0.05f, 0.5f, 3.0f, 12.0f})
      for (const bool coloured : {false, true}) {
        ScreenSplat splat{8, 8, 50, 0, 50, tau, 0.5f, 0, 0, 0.3f, 0, along, 0, 0, 0, 0};
        std::vector<ScreenSplat> splats{splat};
        if (coloured) {
          splats.front().along = 0;
          splats.push_back(ScreenColour{0.5f, {0, 0}, 0.3f, 0, along}.record());
        }
        const PixelShading shading{true, false, nullptr, coloured ? &grey : nullptr};
        const Image image = paint(splats, grey, shading, {16, 16}, glm::vec4(0));
        const float* pixel = image.pixel(8, 8);
        const double side = 1 / std::tanh(0.5 * tau) - 2 / tau;
        const double seen = 0.5 - std::sqrt(3.0) * along * side;
        EXPECT_NEAR(pixel[0] / pixel[3], seen, 4e-3) << along << ' ' << tau << ' ' << coloured;
        // The part of the scalar's variance that goes with the depth shrinks as that of depths weighted by what is
        // seen of them, e^-t from 0 to tau.
        const double depths = std::pow(tau, -2.0) - 0.25 * std::pow(std::sinh(0.5 * double{tau}), -2.0);
        const double variance = 0.03 - along * along * (1 - 12 * depths);
        EXPECT_NEAR(pixel[1] / pixel[3], seen * seen + variance, 4e-3)
            << along << ' ' << tau << ' ' << coloured;
      }
}

// Opaque splats, of which the first one shows. Three have one key. The farther one of the other two leans: where it is looked
// at, its plane lies before the nearer one, but its first key does not.
TEST_P(PainterTest, SplatsComeByKeysHeldAtTheirFirstAndThenInTheirOrder) {
  const ClassificationTable grey([](double f) { return TransferFunction::Value{{f, f, f}, 1}; }, 0, 1);
  const auto splat = [](float x, float mean, uint32_t key, float slope, uint32_t first) {
    return ScreenSplat{x, 8, 6, 0, 6, 200, mean, 0, 0, 0, 0, 0, key, first, slope, 0};
  };
  const std::vector<ScreenSplat> splats{splat(8, 0.2f, 1000, 0, 1000), splat(8, 0.5f, 1000, 0, 1000),
                                        splat(8, 0.8f, 1000, 0, 1000), splat(36, 0.3f, 28000, 0, 28000),
                                        splat(32, 0.9f, 30000, -1000, 29000)};
  Image image;
  backend_->run([&](Painter& painter) {
    painter.begin({48, 16}, kWhite, grey, {});
    painter.draw(splats);
    image = painter.end();
  });
  EXPECT_NEAR(image.pixel(8, 8)[0], 0.2f, 0.01f);
  EXPECT_NEAR(image.pixel(38, 8)[0], 0.3f, 0.01f);
}

TEST_P(PainterTest, AFaceAcrossTheRayLeavesItsShare) {
  // Half of a splat that is seen through a face at its middle; with a scalar that falls along the ray, what
  // is left has the mean of the nearer half.
  const ClassificationTable even([](double) { return TransferFunction::Value{glm::dvec3(0.0), 1}; }, 0, 1);
  ScreenCut cut;
  cut.faces[0] = {0, 0, 0};
  const ScreenSplat splat{8, 8, 4, 0, 4, -1, 0.5f, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  const std::vector<ScreenSplat> pair{splat, cut.record()};
  const Image half = paint(pair, even, true, {16, 16});
  ScreenSplat uncut = splat;
  uncut.amplitude = 0.5f;
  const Image expected = paint({&uncut, 1}, even, true, {16, 16});
  EXPECT_LT(largestDifference(half, expected), 1e-5);
}

TEST_P(PainterTest, TopOfTheImageIsTheFirstRow) {
  const ScreenSplat splat{10, 3, 2, 0, 2, 1, 0.9f, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  const Image image = paint({&splat, 1}, lively(), false, {20, 20});
  EXPECT_LT(image.pixel(10, 3)[2], 0.8f);
  EXPECT_EQ(image.pixel(10, 16)[2], 1.0f);
}

TEST_P(PainterTest, BlendsNearerSplatsOverFartherOnes) {
  const ClassificationTable table(
      [](double f) {
        return TransferFunction::Value{{f > 0.5, 0, f < 0.5}, 100};
      },
      0, 1);
  const std::vector<ScreenSplat> splats{{10, 10, 4, 0, 4, 1, 0.2f, 0, 0, 0, 0, 0, 0, 0, 0, 0},
                                        {10, 10, 4, 0, 4, 1, 0.8f, 0, 0, 0, 0, 0, 0, 0, 0, 0}};
  const Image image = paint(splats, table, true, {20, 20});
  EXPECT_NEAR(image.pixel(10, 10)[0], 1, 1e-5);
  EXPECT_NEAR(image.pixel(10, 10)[2], 0, 1e-5);
}

TEST_P(PainterTest, KeepsVeryThinSplats) {
  // Many layers whose optical depth a float next to 1 hardly tells from nothing.
  const ClassificationTable table([](double) { return TransferFunction::Value{glm::dvec3(0.0), 1}; }, 0, 1);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> amplitude(1e-5f, 3e-5f);
  std::vector<ScreenSplat> splats;
  double depth = 0;
  for (int layer = 0; layer < 50000; ++layer) {
    splats.push_back({2.5f, 2.5f, 1e4f, 0, 1e4f, amplitude(random), 0.5f, 0, 0, 0, 0, 0, 0, 0, 0, 0});
    depth += splats.back().amplitude * footprint(0);
  }
  const Image image = paint(splats, table, true, {5, 5});
  EXPECT_NEAR(image.pixel(2, 2)[0], std::exp(-depth), 2e-4);
}

TEST_P(PainterTest, FarOutsideTheRangeLooksAsJustOutside) {
  // 1 at both ends, of different colours; in between nothing is seen.
  const ClassificationTable table(
      [](double f) {
        return TransferFunction::Value{{f > 0.5, f < 0.5, 0.25}, f <= 0 || f >= 1 ? 1.0 : 0.0};
      },
      0, 1);
  const ImageSize size{20, 20};
  for (const float side : {-1.0f, 1.0f}) {
    const ScreenSplat near{10, 10, 4, 0, 4, 0.7f, 0.5f + side, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    const Image expected = paint({&near, 1}, table, true, size);
    EXPECT_LT(expected.pixel(10, 10)[2], 0.9f);
    for (const float away : {1e2f, 1e4f, 3e5f, 1.9e7f, 1e12f, 1e25f})
      for (const float width : {0.0f, 0.01f, 0.4f})
        for (const bool per_pixel : {true, false}) {
          ScreenSplat far = near;
          far.mean = side * away;
          far.slope0 = 0.1f * width;
          far.half_width = width;
          const Image image = paint({&far, 1}, table, per_pixel, size);
          EXPECT_LT(largestDifference(image, expected), 1e-5)
              << side * away << " ± " << width << ", per pixel: " << per_pixel;
        }
  }
}

TEST_P(PainterTest, DrawsTheSameTwice) {
  const ImageSize size{200, 200};
  const auto splats = randomSplats(2000, 3, size);
  EXPECT_EQ(paint(splats, lively(), true, size).rgba, paint(splats, lively(), true, size).rgba);
}

TEST_P(PainterTest, DrawsFrameAfterFrame) {
  const auto splats = randomSplats(100, 5, {64, 64});
  std::vector<Image> images;
  for (const int side : {64, 32, 64}) images.push_back(paint(splats, lively(), true, {side, side}));
  EXPECT_EQ(images[0].rgba, images[2].rgba);
  EXPECT_EQ(images[1].size.width, 32);
}

TEST_P(PainterTest, ForgetsAFrameThatWasNotEnded) {
  const ImageSize size{40, 30};
  const auto splats = randomSplats(50, 3, size);
  const auto table = lively();
  const Image empty = paint({}, table, true, size);
  backend_->run([&](Painter& painter) {
    painter.begin(size, kWhite, table, {});
    painter.draw(splats);
    painter.begin(size, kWhite, table, {});
    EXPECT_EQ(painter.end().rgba, empty.rgba);
  });
}

TEST(GlPainter, RefusesAnImageBeyondTheLimitAndGoesOn) {
  const auto table = lively();
  GlThread gl(GlLibrary::kOsmesa);
  gl.run([&](const GlContext& context) {
    GlPainter painter(context);
    expectError([&] { painter.begin({1 << 20, 8}, glm::vec4(1), table, {}); }, {"1048576x8"});
    painter.begin({8, 8}, glm::vec4(1), table, {});
    EXPECT_EQ(painter.end().pixel(4, 4)[0], 1.0f);
  });
}

/// Splats that lean, some cut, in the order of their first keys.
std::vector<ScreenSplat> leaningAndCut(int count, ImageSize size, float opacity = 0.5f) {
  std::vector<std::vector<ScreenSplat>> placed;  // each behind its records, which cutSome() has behind it
  std::mt19937 random(5);
  std::uniform_real_distribution<float> around(-1, 1);
  for (const ScreenSplat& element : cutSome(randomSplats(count, 7, size, 0.3f, opacity), 4)) {
    if (isRecord(element)) {
      placed.back().insert(placed.back().begin(), element);
      continue;
    }
    ScreenSplat splat = element;
    splat.key = 20000 + static_cast<uint32_t>(random() % 3000);
    splat.key_slope0 = random() % 3 == 0 ? 0 : 90 * around(random);
    splat.key_slope1 = splat.key_slope0 == 0 ? 0 : 90 * around(random);
    setFirst(splat);
    placed.push_back({splat});
  }
  std::stable_sort(placed.begin(), placed.end(),
                   [](const auto& a, const auto& b) { return a.back().first < b.back().first; });
  std::vector<ScreenSplat> splats;
  for (const auto& one : placed) splats.insert(splats.end(), one.begin(), one.end());
  return splats;
}

Image drawn(Painter& painter, std::span<const ScreenSplat> nearest_first, const ClassificationTable& table,
            ImageSize size) {
  painter.begin(size, kWhite, table, {});
  painter.draw(nearest_first);
  return painter.end();
}

// One tile, whose splats take more than the least that is kept when they are prepared, and less than the most.
TEST(CpuPainter, HasTheSameBitsWhateverIsKeptOfPreparedSplats) {
  const ImageSize size{kTileSide, kTileSide};
  const auto table = lively();
  const auto splats = leaningAndCut(6000, size, 0.002f);
  const auto painted = [&](size_t waiting_splats) {
    Image image;
    makeBackend(Backend::kCpu)->run([&](Painter& painter) {
      painter.begin(size, kWhite, table, {}, {.threads = 1, .waiting_splats = waiting_splats});
      painter.draw(splats);
      image = painter.end();
      EXPECT_FALSE(painter.isOverfull());
    });
    return image;
  };
  EXPECT_EQ(painted(12288).rgba, painted(1 << 17).rgba);
}

// Nearly all splats lie in one tile, which many threads divide among them.
TEST(CpuPainter, HasTheSameBitsWhenThreadsShareATile) {
  const ImageSize size{2 * kTileSide + 9, kTileSide};
  const auto table = lively();
  for (const float opacity : {0.002f, 0.5f}) {  // of the latter much is hidden
    auto splats = leaningAndCut(300, size, opacity);
    const auto of_tile = leaningAndCut(12000, {kTileSide, kTileSide}, opacity);
    splats.insert(splats.end(), of_tile.begin(), of_tile.end());
    std::vector<std::vector<ScreenSplat>> placed(1);  // each behind its records
    for (const ScreenSplat& splat : splats) {
      placed.back().push_back(splat);
      if (!isRecord(splat)) placed.emplace_back();
    }
    placed.pop_back();
    std::stable_sort(placed.begin(), placed.end(),
                     [](const auto& a, const auto& b) { return a.back().first < b.back().first; });
    splats.clear();
    for (const auto& one : placed) splats.insert(splats.end(), one.begin(), one.end());
    const auto painted = [&](const PaintResources& resources) {
      Image image;
      makeBackend(Backend::kCpu)->run([&](Painter& painter) {
        painter.begin(size, kWhite, table, {}, resources);
        painter.draw(splats);
        image = painter.end();
        EXPECT_FALSE(painter.isOverfull());
      });
      return image;
    };
    const Image expected = painted({.threads = 1, .waiting_splats = 1 << 18});
    for (const unsigned threads : {2u, 8u, 40u})
      for (const size_t batch : {size_t{3000}, size_t{65536}})
        EXPECT_EQ(painted({threads, batch, 1 << 18}).rgba, expected.rgba)
            << threads << " threads, batches of " << batch << ", opacity " << opacity;
  }
}

TEST(GlTilePainter, HasTheSameBitsInAnyBatchesAndBoxes) {
  const ImageSize size{70, 50};
  const auto table = lively();
  const auto splats = leaningAndCut(250, size);
  Image expected;
  makeBackend(Backend::kCpu)->run([&](Painter& painter) { expected = drawn(painter, splats, table, size); });
  GlThread gl(GlLibrary::kEgl);
  gl.run([&](const GlContext& context) {
    GlTilePainter whole(context);
    const Image image = drawn(whole, splats, table, size);
    EXPECT_GT(compareImages(image, expected).psnr_db, 60);
    // Less than a batch's splats have in one box, and a box of one tile that has more than there is space for.
    for (const GlTilePainter::Capacity& capacity :
         {GlTilePainter::Capacity{64, 1 << 19}, {200, 1000}, {1000, 200}}) {
      GlTilePainter painter(context, capacity);
      for (const size_t piece : {size_t{3}, splats.size()}) {
        if (capacity.entries == 200 && piece == 3) continue;
        painter.begin(size, kWhite, table, {});
        for (size_t n = 0; n < splats.size(); n += piece)
          painter.draw(std::span(splats).subspan(n, std::min(piece, splats.size() - n)));
        EXPECT_EQ(painter.end().rgba, image.rgba) << capacity.splats << ' ' << piece;
        EXPECT_FALSE(painter.isOverfull());
      }
    }
    GlTilePainter painter(context, {16, 1000});
    painter.begin(size, kWhite, table, {}, {.waiting_splats = 20});
    painter.draw(splats);
    painter.end();
    EXPECT_TRUE(painter.isOverfull());
    EXPECT_TRUE(painter.hides({0, 0, 1, 1}));
  });
}

/// An opaque layer behind all: four depths a pixel, and the bounds of cells of 8, 16, 32, 64 and 128 pixels.
TEST(GlTilePainter, CountsTheLayersAsMemoryOfTheCard) {
  const ImageSize size{70, 50};
  const auto table = lively();
  std::vector<PixelLayers::Row> rows(static_cast<size_t>(size.height));
  for (PixelLayers::Row& row : rows)
    for (int x = 0; x < size.width; ++x) {
      row.layers.push_back({1e6f, glm::vec4(1)});
      row.endPixel(row.layers.size() - 1);
    }
  const PixelLayers layers(size, std::move(rows), 0);
  GlThread gl(GlLibrary::kEgl);
  gl.run([&](const GlContext& context) {
    const auto bytesWith = [&](const PixelLayers* of_pixels) {
      GlTilePainter painter(context);
      painter.begin(size, kWhite, table, {.layers = of_pixels});
      painter.draw(leaningAndCut(250, size));
      painter.end();
      return painter.cardWork().bytes;
    };
    constexpr uint64_t kCells = 9 * 7 + 5 * 4 + 3 * 2 + 2 * 1 + 1;
    EXPECT_EQ(bytesWith(&layers) - bytesWith(nullptr), 16 * size.pixels() + 8 * kCells);
  });
}

TEST(GlTilePainter, DrawsRegionsAsTheWhole) {
  const ImageSize size{70, 50};
  const auto table = lively();
  const auto splats = leaningAndCut(300, size);
  std::vector<uint32_t> owners(TileSet::tilesOf(size, kSharedTileSide), 1);
  for (size_t n = 0; n < owners.size(); ++n) owners[n] = n % 9 >= 5;  // 40 of 70 pixels
  GlThread gl(GlLibrary::kEgl);
  gl.run([&](const GlContext& context) {
    GlTilePainter painter(context, {100, 1000});
    const Image whole = drawn(painter, splats, table, size);
    painter.begin(size, kWhite, table, {});
    for (const uint32_t owner : {0u, 1u}) {
      painter.drawOnly(TileSet(size, owners, owner));
      painter.draw(splats);
    }
    EXPECT_EQ(painter.end().rgba, whole.rgba);
  });
}

TEST(GlTilePainter, HidesOnlyWhatNothingShinesThroughTo) {
  const ImageSize size{64, 40};
  const auto table = lively();
  std::vector<ScreenSplat> splats;
  for (int n = 0; n < 40; ++n)  // over the left half
    splats.push_back({14, 20, 16, 0, 40, 500, 0.55f, 0, 0, 0.3f, 0, 0, 0, 0, 0, 0});
  GlThread gl(GlLibrary::kEgl);
  gl.run([&](const GlContext& context) {
    GlTilePainter painter(context, {8, 1000});
    painter.begin(size, kWhite, table, {});
    EXPECT_FALSE(painter.hides({2, 2, 20, 20}));
    painter.draw(splats);
    EXPECT_TRUE(painter.hides({2, 2, 20, 20}));
    EXPECT_TRUE(painter.hides({-50, 2, 20, 20}));
    EXPECT_FALSE(painter.hides({2, 2, 50, 20}));
    EXPECT_FALSE(painter.hides({NAN, 2, 20, 20}));
    const Image opaque = painter.end();
    EXPECT_GT(opaque.pixel(10, 10)[3], 0.999f);
    // Each of some of the splats lies in 2 x 3 or 3 x 3 tiles of 16 pixels; the tiles that are closed take no more.
    const CardWork work = painter.cardWork();
    EXPECT_GE(work.entries, 8u * 6);
    EXPECT_LT(work.entries, 40u * 6);
    EXPECT_GE(work.bytes, 16 * size.pixels());
    EXPECT_GT(work.paint_s, 0);
    EXPECT_DOUBLE_EQ(work.draw_s, work.list_s + work.sort_s + work.paint_s);
  });
}

TEST(GlTilePainter, CountsWhatPixelsDo) {
  const ImageSize size{48, 40};
  const ScreenSplat splat{21.3f, 17.8f, 3.0f, -1.0f, 2.0f, 0.08f, 0.55f, 0.2f,
                          -0.1f, 0.03f, 0,    0,     0,    0,     0,     0};
  uint64_t inside = 0;
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const double dx = x + 0.5 - 21.3f, dy = y + 0.5 - 17.8f;
      const double u = dx / 3, v = (dy + u) / 2;
      inside += u * u + v * v < kKernelSupport * kKernelSupport;
    }
  GlThread gl(GlLibrary::kEgl);
  gl.run([&](const GlContext& context) {
    for (const std::string asked : {"", "1", "alone"}) {
      setenv("CURVISPLAT_COUNT_PIXELS", asked.c_str(), 1);
      GlTilePainter painter(context);
      unsetenv("CURVISPLAT_COUNT_PIXELS");
      for (const uint64_t copies : {3, 1}) {
        const Image image = drawn(painter, std::vector<ScreenSplat>(copies, splat), lively(), size);
        EXPECT_EQ(image.pixel(21, 17)[2] == 1.0f, asked == "alone");  // white, where nothing is blended
        const CardWork work = painter.cardWork();
        EXPECT_EQ(work.pixels_blended, asked.empty() ? 0 : copies * inside);
        // Each pixel of a tile of 16 looks at all splats of its list.
        EXPECT_EQ(work.pixels_listed % (16 * 8), 0u);
        EXPECT_LE(work.pixels_listed, 256 * work.entries);
        EXPECT_GE(work.pixels_listed, work.pixels_blended);
      }
    }
  });
}

TEST(GlTilePainter, RefusesWhatTheCardCannotHoldAndGoesOn) {
  const auto table = lively();
  GlThread gl(GlLibrary::kEgl);
  gl.run([&](const GlContext& context) {
    GlTilePainter painter(context);
    expectError([&] { painter.begin({1 << 20, 8}, kWhite, table, {}); }, {"1048576x8", "--size"});
    expectError([&] { CardBuffer(context.functions()).reserve(uint64_t{1} << 50); }, {"MiB", "egl-quads"});
    painter.begin({8, 8}, kWhite, table, {});
    EXPECT_EQ(painter.end().pixel(4, 4)[0], 1.0f);
  });
}

TEST(GlFunctions, SaysWhatToDoWhereThereIsNoMemory) {
  GlThread gl(GlLibrary::kEgl);
  gl.run([&](const GlContext& context) {
    GlFunctions full = context.functions();
    full.GetError = [] { return GLenum{GL_OUT_OF_MEMORY}; };
    expectError([&] { CardBuffer(full).reserve(1 << 20); }, {"memory", "lists of tiles", "--backend cpu"});
  });
}

TEST(GlThread, HandsErrorsToTheCaller) {
  GlThread gl(GlLibrary::kOsmesa);
  expectSays(gl.contextName(), "OpenGL");
  EXPECT_THROW(gl.run([](const GlContext&) { throw Error("no"); }), Error);
  bool ran = false;
  gl.run([&](const GlContext&) { ran = true; });
  EXPECT_TRUE(ran);
}

}  // namespace
}  // namespace curvisplat
