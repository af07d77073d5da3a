#include "render/frame/frame.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numeric>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/reference/global_order.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

/// A camera outside, looking at the middle of the lattice.
Camera cameraFrom(const glm::dvec3& direction, double parallel_scale = 24) {
  Camera camera;
  camera.focal_point = glm::dvec3(0.5 * kLatticeSide);
  camera.position = camera.focal_point + 80.0 * direction;
  camera.view_up = std::abs(direction.z) > 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, 1);
  camera.parallel_scale = parallel_scale;
  return camera;
}

/// The pipeline, with each backend.
class FrameTest : public testing::TestWithParam<Backend> {
 protected:
  /// Writes and opens a lattice.
  const CacheReader& lattice(double constant, const glm::dvec3& gradient) {
    writeLatticeCache(path(), constant, gradient);
    cache_ = std::make_unique<CacheReader>(path());
    return *cache_;
  }
  std::filesystem::path path() const { return folder_ / "lattice.splats"; }

  /// Points [scalar, red, green, blue] and [scalar, opacity per unit length], as ParaView has them.
  TransferFunction function(const std::string& colours, const std::string& opacities) {
    const auto file = folder_ / "function.json";
    writeFileAtomically(file, "[{\"ColorSpace\": \"RGB\", \"Name\": \"test\", \"RGBPoints\": [" + colours +
                                  "], \"Points\": [" + opacities + "]}]");
    return TransferFunction::fromFile(file, nullptr, 1.0, 1.0);
  }
  /// Black, everywhere equally opaque.
  TransferFunction uniform(double extinction) {
    const double opacity = -std::expm1(-extinction);
    return function("0, 0, 0, 0, 1, 0, 0, 0", fmt::format("0, {0}, 0.5, 0, 1, {0}, 0.5, 0", opacity));
  }
  TransferFunction redToBlue() {
    return function("0, 1, 0, 0, 1, 0, 0, 1", "0, 0.05, 0.5, 0, 1, 0.05, 0.5, 0");
  }

  static FrameOptions options(double lod_pixels = 0) {
    FrameOptions made;
    made.size = {120, 100};
    made.lod_pixels = lod_pixels;
    return made;
  }

  TemporaryFolder folder_;
  std::unique_ptr<CacheReader> cache_;
};

INSTANTIATE_TEST_SUITE_P(Backends, FrameTest, testing::Values(Backend::kOsmesa, Backend::kCpu),
                         [](const testing::TestParamInfo<Backend>& tested) {
                           return tested.param == Backend::kOsmesa ? "osmesa" : "cpu";
                         });

TEST_P(FrameTest, AConstantFieldIsFlat) {
  const double extinction = 0.03;
  FrameRenderer renderer(lattice(0.5, glm::dvec3(0)), 0, uniform(extinction), GetParam());
  FrameStatistics statistics;
  // Leaves, and the merged root alone.
  for (const double lod_pixels : {0.0, 1e3}) {
    const Image image = renderer.render(cameraFrom({0, 0, 1}), options(lod_pixels), statistics);
    EXPECT_EQ(statistics.bricks_drawn, lod_pixels == 0 ? 64u : 1u);
    EXPECT_EQ(statistics.splats_drawn, 512 * statistics.bricks_drawn);
    const double expected = std::exp(-extinction * kLatticeSide);
    const double px = 100 / 48.0;  // a unit's pixels
    const double margin = lod_pixels == 0 ? 3 * px : 8 * px;
    for (int y = 0; y < 100; ++y)
      for (int x = 0; x < 120; ++x) {
        const double inside = 16 * px - std::max(std::abs(x + 0.5 - 60), std::abs(y + 0.5 - 50));
        if (inside > margin) {
          EXPECT_NEAR(image.pixel(x, y)[0], expected, 0.01 * expected) << x << ' ' << y;
        }
        if (inside < -margin) {
          EXPECT_EQ(image.pixel(x, y)[0], 1.0f) << x << ' ' << y;
        }
      }
  }
}

// A layer of plates of four pixels, with constant extinction and grey values from 0 to 1 through it: what is seen of it is the mean
// grey value, weighted by what is left of the ray. Obliquely several plates lie behind one another in a pixel.
TEST_P(FrameTest, PlatesBesideOneAnotherAreOneLayer) {
  constexpr double kThickness = 0.125, kDepth = 1;
  writePlatesCache(path(), kThickness);
  const CacheReader cache(path());
  const double opacity = -std::expm1(-kDepth / kThickness);
  const TransferFunction grey =
      function("0, 0, 0, 0, 1, 1, 1, 1", fmt::format("0, {0}, 0.5, 0, 1, {0}, 0.5, 0", opacity));
  FrameRenderer renderer(cache, 0, grey, GetParam());
  FrameOptions wanted = options();
  wanted.background = glm::vec4(0, 0, 0, 1);
  for (const double degrees : {0.0, 30.0, 60.0, 80.0}) {
    const double angle = degrees * M_PI / 180, tau = kDepth / std::cos(angle);
    const glm::dvec3 direction(0.8 * std::sin(angle), 0.6 * std::sin(angle), std::cos(angle));
    FrameStatistics statistics;
    const Image image = renderer.render(cameraFrom(direction, 12.5), wanted, statistics);
    double sum = 0;
    for (int y = 47; y < 53; ++y)
      for (int x = 50; x < 70; ++x) sum += image.pixel(x, y)[0] / 120;
    EXPECT_NEAR(sum, 1 + std::expm1(-tau) / tau, 0.02) << degrees;
  }
}

TEST_P(FrameTest, PerspectiveRaysOfAConstantFieldHaveTheirLength) {
  const double extinction = 0.03;
  FrameRenderer renderer(lattice(0.5, glm::dvec3(0)), 0, uniform(extinction), GetParam());
  Camera camera = cameraFrom({0, 0, 1});
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = 80;
  FrameStatistics statistics;
  // From outside, and from inside of the data, looking at the corner of a wide image.
  for (const double height : {34.0, 20.0}) {
    camera.position = {16, 16, height};
    const Image image = renderer.render(camera, options(), statistics);
    for (const int x : {40, 60, 62}) {
      const double tangent = (x + 0.5 - 60) / (50 / std::tan(40 * M_PI / 180));
      const double length = std::min(height, 32.0) * std::hypot(1, tangent);
      const double expected = std::exp(-extinction * length);
      ASSERT_LT(std::abs(tangent * height), 12);
      EXPECT_NEAR(image.pixel(x, 50)[0], expected, 0.015 * expected) << height << ' ' << x;
    }
  }
}

TEST_P(FrameTest, TheNearSideHidesTheFarSide) {
  FrameRenderer renderer(lattice(0, {1.0 / kLatticeSide, 0, 0}), 0,
                         function("0, 1, 0, 0, 1, 0, 0, 1", "0, 0.9, 0.5, 0, 1, 0.9, 0.5, 0"), GetParam());
  FrameStatistics statistics;
  for (const double lod_pixels : {0.0, 4.0}) {
    const Image from_low = renderer.render(cameraFrom({-1, 0, 0}), options(lod_pixels), statistics);
    const Image from_high = renderer.render(cameraFrom({1, 0, 0}), options(lod_pixels), statistics);
    EXPECT_GT(from_low.pixel(60, 50)[0], 0.9f);
    EXPECT_LT(from_low.pixel(60, 50)[2], 0.1f);
    EXPECT_LT(from_high.pixel(60, 50)[0], 0.1f);
    EXPECT_GT(from_high.pixel(60, 50)[2], 0.9f);
  }
}

TEST_P(FrameTest, IsTheSameForAnyThreadsAndMemory) {
  FrameRenderer renderer(lattice(0, {0.02, 0.01, 0}), 0, redToBlue(), GetParam());
  Camera camera = cameraFrom(glm::dvec3(0.6, 0.64, 0.48));
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    camera.projection = projection;
    camera.view_angle_deg = 35;
    FrameStatistics statistics;
    std::vector<float> first;
    for (const unsigned threads : {1u, 2u, 4u, 3u})
      for (const uint64_t memory : {uint64_t{1} << 30, uint64_t{56} << 20}) {
        if (GetParam() == Backend::kOsmesa && threads % 2 == memory >> 30) continue;  // each once
        FrameOptions wanted = options(2);
        wanted.threads = threads;
        wanted.memory_bytes = memory;
        const Image image = renderer.render(camera, wanted, statistics);
        if (first.empty()) first = image.rgba;
        EXPECT_EQ(image.rgba, first) << threads << " threads, " << memory << " bytes";
      }
    EXPECT_GT(*std::max_element(first.begin(), first.end()) - *std::min_element(first.begin(), first.end()),
              0.2f);
  }
}

TEST_P(FrameTest, IsThatOfOneGlobalDepthSort) {
  const CacheReader& cache = lattice(0, {0.02, 0.01, 0});
  const TransferFunction transfer_function = redToBlue();
  FrameRenderer renderer(cache, 0, transfer_function, GetParam());
  FrameStatistics statistics;
  for (const glm::dvec3& direction : {glm::dvec3(0.6, 0.64, 0.48), glm::dvec3(0, 0, 1)}) {
    const Camera camera = cameraFrom(direction);
    EXPECT_EQ(renderer.render(camera, options(), statistics).rgba,
              globallySorted(cache, transfer_function, GetParam(), camera, options()).rgba);
  }
}

TEST_P(FrameTest, CountsWhySplatsWereLeftOut) {
  const CacheReader& cache = lattice(0, {1.0 / kLatticeSide, 0, 0});
  FrameStatistics statistics;
  // Only the half from 0.5 on can be seen; slopes reach a little further.
  FrameRenderer half(cache, 0,
                     function("0, 1, 0, 0, 1, 0, 0, 1", "0, 0, 0.5, 0, 0.9, 0, 0.5, 0, 1, 0.5, 0.5, 0"),
                     GetParam());
  half.render(cameraFrom({0, 0, 1}), options(), statistics);
  EXPECT_GT(statistics.bricks_transparent, 0u);
  EXPECT_EQ(statistics.bricks_culled, statistics.bricks_transparent);
  EXPECT_LT(statistics.bricks_drawn, 64u);
  EXPECT_GT(statistics.splats_drawn, 0u);
  EXPECT_GT(statistics.splats_transparent, 0u);
  EXPECT_EQ(statistics.splats_read, statistics.splats_drawn + statistics.splats_transparent);
  EXPECT_GT(statistics.bytes_read, 0u);

  FrameRenderer all(cache, 0, uniform(0.1), GetParam());
  FrameOptions clipped = options();
  clipped.clip_box = WorldBox{glm::dvec3(0), glm::dvec3(16, 32, 32)};
  all.render(cameraFrom({0, 0, 1}), clipped, statistics);
  // Those that the face at 16 goes through are cut; bricks behind it are not even read.
  EXPECT_GT(statistics.splats_drawn, 16u * 32 * 32);
  EXPECT_LE(statistics.splats_drawn, 18u * 32 * 32);
  EXPECT_EQ(statistics.splats_clipped, statistics.splats_read - statistics.splats_drawn);
  EXPECT_GT(statistics.splats_clipped, 0u);
  EXPECT_GT(statistics.bricks_out_of_image, 0u);

  Camera away = cameraFrom({0, 0, 1});
  away.focal_point += glm::dvec3(1000, 0, 0);
  away.position += glm::dvec3(1000, 0, 0);
  const Image empty = all.render(away, options(), statistics);
  EXPECT_EQ(statistics.bricks_drawn, 0u);
  EXPECT_GT(statistics.bricks_out_of_image, 0u);
  EXPECT_TRUE(std::all_of(empty.rgba.begin(), empty.rgba.end(), [](float value) { return value == 1; }));
}

TEST_P(FrameTest, CullingChangesNothingInThePicture) {
  // A camera close by sees some bricks; with the clip box around all data nothing else changes.
  FrameRenderer renderer(lattice(0, {0.02, 0.01, 0}), 0,
                         function("0, 1, 0, 0, 1, 0, 0, 1", "0, 0, 0.5, 0, 0.4, 0, 0.5, 0, 0.5, 0.5, 0.5, 0"),
                         GetParam());
  FrameStatistics near_statistics, far_statistics;
  FrameOptions small = options(), large = options();
  small.size = {40, 40};
  large.size = {240, 240};
  const Image near = renderer.render(cameraFrom({0, 0, 1}, 4), small, near_statistics);
  const Image far = renderer.render(cameraFrom({0, 0, 1}, 24), large, far_statistics);
  EXPECT_LT(near_statistics.bricks_drawn, far_statistics.bricks_drawn);
  double largest = 0;
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x)
      largest = std::max<double>(largest, std::abs(near.pixel(x, y)[0] - far.pixel(x + 100, y + 100)[0]));
  // Where a splat is cut by the edge of a tile or of the image, the processor's fits to the classification
  // differ.
  EXPECT_LT(largest, GetParam() == Backend::kCpu ? 1e-3 : 1e-4);
}

TEST_P(FrameTest, StretchesTheData) {
  FrameRenderer renderer(lattice(0.5, glm::dvec3(0)), 0, uniform(0.01), GetParam());
  FrameOptions stretched = options();
  stretched.scale = {1, 1, 3};
  FrameStatistics statistics;
  Camera camera = cameraFrom({0, 0, 1});
  camera.position.z = 200;
  const Image image = renderer.render(camera, stretched, statistics);
  EXPECT_NEAR(image.pixel(60, 50)[0], std::exp(-0.01 * 3 * kLatticeSide), 5e-3);
  stretched.scale = {0.5, 1, 1};
  const Image narrow = renderer.render(cameraFrom({0, 0, 1}), stretched, statistics);
  EXPECT_EQ(narrow.pixel(85, 50)[0], 1.0f);
}

TEST_P(FrameTest, ADamagedBrickEndsTheFrameWithItsName) {
  lattice(0, {0.02, 0.01, 0});
  const Brick brick = cache_->bricks()[40];
  {
    std::fstream file(path() / "geometry.bin", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(brick.geometry.offset));
    file.put('\x55').put('\x55').put('\x55');
  }
  FrameRenderer renderer(*cache_, 0, redToBlue(), GetParam());
  FrameStatistics statistics;
  for (const unsigned threads : {1u, 4u}) {
    FrameOptions wanted = options();
    wanted.threads = threads;
    expectError([&] { renderer.render(cameraFrom({0, 0, 1}), wanted, statistics); }, {"brick 40"});
  }
  // What is whole can still be drawn.
  EXPECT_NO_THROW(renderer.render(cameraFrom({0, 0, 1}), options(1e3), statistics));
}

TEST_P(FrameTest, ReportsTheMemoryItTakes) {
  FrameRenderer renderer(lattice(0.5, glm::dvec3(0)), 0, uniform(0.1), GetParam());
  FrameOptions little = options();
  little.memory_bytes = 1 << 20;
  FrameStatistics statistics;
  try {
    renderer.render(cameraFrom({0, 0, 1}), little, statistics);
    ADD_FAILURE() << "a megabyte was enough";
  } catch (const UsageError& error) {
    expectSays(error.what(), "--memory");
  }
}

}  // namespace
}  // namespace curvisplat
