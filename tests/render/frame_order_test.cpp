// The splats of each order tile are drawn in one order, whatever the view, the level of detail, the memory and the threads:
// bit for bit as if those that touch it were sorted all together. OpenGL's painter draws fewer cases: it takes a hundred
// times as long on the processor, and what brings splats into their order is shared (render/tiles).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/frame/frame.h"
#include "render/mesh/triangle_mesh.h"
#include "render/surface/surface_scene.h"
#include "stream/base/error.h"
#include "tests/reference/global_order.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

/// Tests of each backend.
class FrameOrderTest : public testing::TestWithParam<Backend> {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {80, 40, 40}), *folder_ / "scene.splats");
    scene_ = std::make_unique<CacheReader>(*folder_ / "scene.splats");
    convertGrid(SceneGridSource(makeScene("half-annulus"), {40, 20, 20}), *folder_ / "coarse.splats");
    coarse_ = std::make_unique<CacheReader>(*folder_ / "coarse.splats");
    writeRandomCache(*folder_ / "random.splats", 5, 3000);
    random_ = std::make_unique<CacheReader>(*folder_ / "random.splats");
    writeRandomCache(*folder_ / "crowd.splats", 5, 10000);
    crowd_ = std::make_unique<CacheReader>(*folder_ / "crowd.splats");
    writeRandomCache(*folder_ / "crowded.splats", 5, kCrowd);
    crowded_ = std::make_unique<CacheReader>(*folder_ / "crowded.splats");
  }
  static void TearDownTestSuite() {
    scene_.reset();
    coarse_.reset();
    random_.reset();
    crowd_.reset();
    crowded_.reset();
    folder_.reset();
  }

  /// A scene: for OpenGL's painter one of fewer splats and in one brick, since each splat takes it a microsecond and more.
  static CacheReader* scene() { return GetParam() == Backend::kCpu ? scene_.get() : coarse_.get(); }
  /// Random splats that take more than one slab.
  static CacheReader* slabbed() { return GetParam() == Backend::kCpu ? crowded_.get() : crowd_.get(); }

  static FrameOptions options(double lod_pixels = 0) {
    FrameOptions made;
    made.size = GetParam() == Backend::kCpu ? ImageSize{26, 18} : ImageSize{14, 11};
    made.lod_pixels = lod_pixels;
    return made;
  }
  /// Strong colours: an order that is wrong shows.
  static TransferFunction function(const CacheReader& cache) {
    const VariableInfo& info = cache.manifest().variables[0];
    const double diagonal = glm::length(cache.manifest().upper - cache.manifest().lower);
    return TransferFunction::preset("cool-warm", info.min, info.max, 0.02 * diagonal);
  }
  static Camera looking(const CacheReader& cache, const glm::dvec3& direction) {
    const Manifest& manifest = cache.manifest();
    Camera camera =
        Camera::named("+x", manifest.lower, manifest.upper, options().size, Projection::kOrthographic, 30);
    camera.position = camera.focal_point - glm::length(manifest.upper - manifest.lower) * direction;
    camera.view_up = std::abs(direction.z) > 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(0, 0, 1);
    return camera;
  }
  static Camera inside(const CacheReader& cache) {
    const Manifest& manifest = cache.manifest();
    Camera camera = looking(cache, {1, 0, 0});
    camera.projection = Projection::kPerspective;
    camera.view_angle_deg = 60;
    camera.position = manifest.lower + glm::dvec3(0.2, 0.5, 0.5) * (manifest.upper - manifest.lower);
    return camera;
  }
  /// Usually each cache is drawn from one side: the crowd from outside.
  static bool isLeftToWhole(const CacheReader& cache, const Camera& camera) {
    const bool is_outside = camera.projection == Projection::kOrthographic;
    return is_outside == (&cache == scene()) && !faults::isWholeSweep();
  }
  /// The least memory that renders at all.
  static uint64_t leastMemory(FrameRenderer& renderer, const Camera& camera, FrameOptions wanted) {
    wanted.memory_bytes = 1 << 20;
    wanted.threads = 8;  // as many as any test has: each takes some
    FrameStatistics statistics;
    try {
      renderer.render(camera, wanted, statistics);
    } catch (const UsageError& error) {
      const std::string message = error.what();
      return std::stoull(message.substr(message.find("at least ") + 9)) << 20;
    }
    return wanted.memory_bytes;
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static std::unique_ptr<CacheReader> scene_, coarse_, random_, crowd_, crowded_;
  static constexpr size_t kCrowd = 20000;
};

std::unique_ptr<TemporaryFolder> FrameOrderTest::folder_;
std::unique_ptr<CacheReader> FrameOrderTest::scene_, FrameOrderTest::coarse_, FrameOrderTest::random_,
    FrameOrderTest::crowd_, FrameOrderTest::crowded_;

INSTANTIATE_TEST_SUITE_P(Backends, FrameOrderTest,
                         testing::Values(Backend::kOsmesa, Backend::kEgl, Backend::kCpu),
                         [](const testing::TestParamInfo<Backend>& tested) {
                           return tested.param == Backend::kOsmesa ? "osmesa"
                                  : tested.param == Backend::kEgl  ? "egl"
                                                                   : "cpu";
                         });

TEST_P(FrameOrderTest, IsThatOfOneSortInAnyView) {
  for (const CacheReader* cache : {scene(), random_.get()}) {
    if (GetParam() == Backend::kEgl && cache == scene() && !faults::isWholeSweep()) continue;  // as OSMesa's
    const TransferFunction transfer_function = function(*cache);
    FrameRenderer renderer(*cache, 0, transfer_function, GetParam());
    std::vector<Camera> cameras{inside(*cache)};
    for (const glm::dvec3& direction :
         {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1), glm::dvec3(1, 0.0017, 0.001),
          glm::dvec3(0.01, 1, 0.014), glm::dvec3(0.04, 0.03, -1), glm::dvec3(0.6, 0.64, 0.48)})
      cameras.push_back(looking(*cache, glm::normalize(direction)));
    if (GetParam() != Backend::kCpu)
      cameras.resize(GetParam() == Backend::kEgl ? 1 : 2);
    else if (cache == scene() && !faults::isWholeSweep())
      cameras.resize(3);
    for (size_t n = 0; n < cameras.size(); ++n) {
      FrameStatistics statistics;
      const Image image = renderer.render(cameras[n], options(), statistics);
      const Image expected = globallySorted(*cache, transfer_function, GetParam(), cameras[n], options());
      EXPECT_EQ(image.rgba, expected.rgba) << "camera " << n;
      EXPECT_EQ(statistics.slabs, 1u);
      EXPECT_NE(*std::max_element(image.rgba.begin(), image.rgba.end()),
                *std::min_element(image.rgba.begin(), image.rgba.end()));
    }
  }
}

TEST_P(FrameOrderTest, IsThatOfOneSortAtAnyLevelAndWithPartsOfBricks) {
  if (GetParam() == Backend::kEgl) GTEST_SKIP() << "as OSMesa's";
  struct Case {
    const CacheReader* cache;
    double lod_pixels;
    uint64_t limit;
  };
  for (const Case& tried :
       {Case{random_.get(), 0, 5'000}, {random_.get(), 4, 1'000'000}, {scene_.get(), 0, 100'000}}) {
    if (GetParam() != Backend::kCpu && tried.cache == scene_.get() && !faults::isWholeSweep()) continue;
    const TransferFunction transfer_function = function(*tried.cache);
    FrameRenderer renderer(*tried.cache, 0, transfer_function, GetParam());
    const Camera camera = inside(*tried.cache);
    FrameOptions wanted = options(tried.lod_pixels);
    wanted.max_splats = tried.limit;
    FrameStatistics statistics;
    const Image image = renderer.render(camera, wanted, statistics);
    EXPECT_EQ(image.rgba, globallySorted(*tried.cache, transfer_function, GetParam(), camera, wanted).rgba)
        << tried.lod_pixels << ' ' << tried.limit;
    FrameStatistics of_all;
    renderer.render(camera, options(), of_all);
    EXPECT_LT(statistics.splats_read, of_all.splats_read) << tried.lod_pixels << ' ' << tried.limit;
  }
}

TEST_P(FrameOrderTest, IsThatOfOneSortInAnyMemoryWithAnyThreads) {
  if (GetParam() == Backend::kEgl && !faults::isWholeSweep()) GTEST_SKIP() << "as OSMesa's";
  uint64_t most_slabs = 0, again = 0;
  for (const CacheReader* cache : {scene(), slabbed()}) {
    const TransferFunction transfer_function = function(*cache);
    FrameRenderer renderer(*cache, 0, transfer_function, GetParam());
    for (const Camera& camera : {looking(*cache, {0, 0, 1}), inside(*cache)}) {
      if (isLeftToWhole(*cache, camera)) continue;
      const Image expected = globallySorted(*cache, transfer_function, GetParam(), camera, options());
      const uint64_t least = leastMemory(renderer, camera, options());
      for (const uint64_t memory : {least, least + (3 << 20), least + (40 << 20)})
        for (const unsigned threads : {1u, 3u}) {
          if (GetParam() != Backend::kCpu && (memory != least || threads == 1)) continue;
          // Usually each amount once, and the least with both.
          const bool is_usual = memory == least || (threads == 1) == (memory > least + (3 << 20));
          if (!is_usual && !faults::isWholeSweep()) continue;
          FrameOptions wanted = options();
          wanted.memory_bytes = memory;
          wanted.threads = threads;
          FrameStatistics statistics;
          EXPECT_EQ(renderer.render(camera, wanted, statistics).rgba, expected.rgba)
              << memory << ' ' << threads;
          most_slabs = std::max(most_slabs, statistics.slabs);
          again = std::max(again, statistics.bricks_again);
          EXPECT_LE(statistics.cache_peak_bytes + statistics.pager_peak_bytes + statistics.ring_peak_bytes +
                        statistics.sweep_peak_bytes,
                    memory);
        }
    }
  }
  EXPECT_GT(most_slabs, 2u);
  EXPECT_GT(again, 10u);
}

// A splat and the record of its cut follow one another, wherever a slab ends.
TEST_P(FrameOrderTest, IsThatOfOneSortWithClipPlanesAndLight) {
  if (GetParam() == Backend::kEgl && !faults::isWholeSweep()) GTEST_SKIP() << "as OSMesa's";
  uint64_t most_slabs = 0;
  for (const CacheReader* cache : {scene(), slabbed()}) {
    const TransferFunction transfer_function = function(*cache);
    FrameRenderer renderer(*cache, 0, transfer_function, GetParam());
    const Manifest& manifest = cache->manifest();
    const glm::dvec3 extent = manifest.upper - manifest.lower;
    FrameOptions cut = options();
    cut.clip_planes = {{manifest.lower + 0.15 * extent, {1, 0.5, 0.25}},
                       {manifest.lower + 0.8 * extent, {-0.25, -1, -0.5}}};
    cut.light.emplace();
    cut.light->towards = glm::dvec3(1, -2, 3);
    for (const Camera& camera : {looking(*cache, {0, 0, 1}), inside(*cache)}) {
      if (isLeftToWhole(*cache, camera)) continue;
      const Image expected = globallySorted(*cache, transfer_function, GetParam(), camera, cut);
      FrameStatistics statistics;
      EXPECT_NE(expected.rgba, renderer.render(camera, options(), statistics).rgba);
      const uint64_t least = leastMemory(renderer, camera, cut);
      for (const uint64_t memory : {least, least + (40 << 20)}) {
        FrameOptions wanted = cut;
        wanted.memory_bytes = memory;
        wanted.threads = 2;
        EXPECT_EQ(renderer.render(camera, wanted, statistics).rgba, expected.rgba) << memory;
        most_slabs = std::max(most_slabs, statistics.slabs);
      }
    }
  }
  EXPECT_GT(most_slabs, 1u);
}

/// A sheet through a cache's data, from corner to corner.
std::shared_ptr<const SurfaceScene> sheetThrough(const CacheReader& cache, double opacity) {
  const glm::dvec3 lower = cache.manifest().lower, extent = cache.manifest().upper - lower;
  RawMesh sheet{{}, {{0, 1, 2}, {0, 2, 3}}};
  for (const glm::dvec3& corner :
       {glm::dvec3(0, 0, 0.1), glm::dvec3(1, 0, 0.4), glm::dvec3(1, 1, 1), glm::dvec3(0, 1, 0.6)})
    sheet.positions.push_back(lower + corner * extent);
  auto scene = std::make_shared<SurfaceScene>();
  scene->surfaces.emplace_back().mesh = std::make_shared<TriangleMesh>(meshOf(std::move(sheet)));
  scene->surfaces.back().opacity.factor = opacity;
  return scene;
}

// Layers of thin cells that lean, with a layer of the picture's pixels among them.
TEST_P(FrameOrderTest, IsThatOfOneSortWithSurfacesAndTwoScalars) {
  if (GetParam() == Backend::kEgl) GTEST_SKIP() << "as OSMesa's";
  convertGrid(SceneGridSource(makeScene("boundary-layer"), {16, 40, 16}), *folder_ / "leaning.splats");
  const CacheReader cache(*folder_ / "leaning.splats");
  const VariableInfo& info = cache.manifest().variables[0];
  const double diagonal = glm::length(cache.manifest().upper - cache.manifest().lower);
  const DrawnScalars one(0, function(cache));
  const DrawnScalars two({0, function(cache)},
                         {0, TransferFunction::preset("viridis", info.min, info.max, diagonal)});
  const Camera camera = looking(cache, glm::normalize(glm::dvec3(0.6, 0.64, 0.48)));
  Image last;
  for (const DrawnScalars& scalars : {one, two})
    for (const double opacity : {0.5, 1.0}) {
      const bool is_usual = GetParam() == Backend::kCpu || (opacity == 1) == scalars.colour.has_value();
      if (!is_usual && !faults::isWholeSweep()) continue;
      FrameOptions wanted = options();
      wanted.scene = sheetThrough(cache, opacity);
      const Image expected = globallySorted(cache, scalars, GetParam(), camera, wanted);
      EXPECT_NE(expected.rgba, last.rgba);
      last = expected;
      FrameRenderer renderer(cache, scalars, GetParam());
      const uint64_t least = leastMemory(renderer, camera, wanted);
      for (const auto& [memory, threads] : {std::pair{least, 5u}, std::pair{least + (40 << 20), 2u}}) {
        if (GetParam() != Backend::kCpu && memory != least && !faults::isWholeSweep()) continue;
        wanted.memory_bytes = memory;
        wanted.threads = threads;
        FrameStatistics statistics;
        EXPECT_EQ(renderer.render(camera, wanted, statistics).rgba, expected.rgba)
            << opacity << ' ' << memory << ' ' << threads;
      }
    }
}

// Thin cells, 200 times as long as thick, of whose layers several lie in a pixel.
TEST_P(FrameOrderTest, MergesLayersOfThinCellsToOnePictureInAnyMemoryWithAnyThreads) {
  if (GetParam() == Backend::kEgl) GTEST_SKIP() << "as OSMesa's";
  const SceneGridSize dims =
      GetParam() == Backend::kCpu ? SceneGridSize{48, 40, 48} : SceneGridSize{16, 40, 16};
  convertGrid(SceneGridSource(makeScene("boundary-layer"), dims), *folder_ / "layers.splats");
  const CacheReader cache(*folder_ / "layers.splats");
  const TransferFunction transfer_function = function(cache);
  FrameRenderer renderer(cache, 0, transfer_function, GetParam());
  const Camera camera = looking(cache, glm::normalize(glm::dvec3(0.6, 0.64, 0.48)));
  FrameStatistics statistics;
  FrameOptions wanted = options();
  wanted.size =
      GetParam() == Backend::kCpu ? ImageSize{40, 30} : ImageSize{28, 22};  // more pixels merge less
  const Image finest = renderer.render(camera, wanted, statistics);
  const uint64_t stored = statistics.splats_drawn;
  wanted.lod_pixels = 1;
  const Image expected = globallySorted(cache, transfer_function, GetParam(), camera, wanted);
  EXPECT_GT(compareImages(expected, finest).psnr_db, 45);
  const uint64_t least = leastMemory(renderer, camera, wanted);
  for (const uint64_t memory : {least, uint64_t{1} << 30})
    for (const unsigned threads : {1u, 3u, 3u}) {  // again with the bricks that the last picture has left
      wanted.memory_bytes = memory;
      wanted.threads = threads;
      EXPECT_EQ(renderer.render(camera, wanted, statistics).rgba, expected.rgba) << memory << ' ' << threads;
      EXPECT_LT(statistics.splats_drawn, 0.75 * static_cast<double>(stored));
    }
  wanted.light.emplace();  // shows the splats themselves
  renderer.render(camera, wanted, statistics);
  EXPECT_EQ(statistics.splats_drawn, stored);
}

// The order includes what stands in for a damaged brick; and each is reported once.
TEST_P(FrameOrderTest, IsTheSameInSlabsWhereBricksAreDamaged) {
  if (GetParam() == Backend::kEgl) GTEST_SKIP() << "as OSMesa's";
  TemporaryFolder folder;
  writeRandomCache(folder / "damaged.splats", 5, GetParam() == Backend::kCpu ? kCrowd : 10000);
  const CacheReader cache(folder / "damaged.splats");
  for (const size_t from_end : {1u, 8u, 20u}) {
    std::fstream file(cache.geometryPath(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(cache.bricks()[cache.bricks().size() - from_end].geometry.offset));
    file.put('\x55').put('\x5a').put('\xa5');
  }
  FrameRenderer renderer(cache, 0, function(cache), GetParam());
  const Camera camera = looking(cache, {0, 0, 1});
  FrameOptions wanted = options();
  wanted.keep_going = true;
  FrameStatistics statistics;
  const Image image = renderer.render(camera, wanted, statistics);
  EXPECT_EQ(statistics.slabs, 1u);
  EXPECT_EQ(statistics.bricks_unreadable.size(), 3u);
  const uint64_t splats = statistics.splats_drawn;
  wanted.memory_bytes = leastMemory(renderer, camera, wanted);
  for (const unsigned threads : {1u, 2u}) {
    wanted.threads = threads;
    EXPECT_EQ(renderer.render(camera, wanted, statistics).rgba, image.rgba);
    EXPECT_GT(statistics.slabs, 1u);
    EXPECT_EQ(statistics.bricks_unreadable.size(), 3u);
    EXPECT_EQ(statistics.splats_drawn, splats);
  }
}

}  // namespace
}  // namespace curvisplat
