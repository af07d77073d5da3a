// Frames of a converted scene: coarse ones first, and limited ones; and regions of a picture whose cut has
// larger layers than the sweep can hold.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <random>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/frame/frame.h"
#include "render/frame/frame_memory.h"
#include "render/sweep/hidden_bricks.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/reference_march.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

class ProgressiveTest : public testing::Test {
 protected:
  /// The half-annulus of 128 x 64 x 64 nodes: 524,288 splats, three levels.
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {128, 64, 64}), *folder_ / "scene.splats");
    cache_ = std::make_unique<CacheReader>(*folder_ / "scene.splats");
  }
  static void TearDownTestSuite() {
    cache_.reset();
    folder_.reset();
  }

  static Camera camera(Projection projection) {
    Camera camera = halfAnnulusCamera();
    camera.projection = projection;
    camera.view_angle_deg = 40;
    if (projection == Projection::kPerspective)
      camera.position = camera.focal_point + 3.0 * (camera.position - camera.focal_point) /
                                                 glm::length(camera.position - camera.focal_point);
    return camera;
  }
  static TransferFunction function() {
    return TransferFunction::fromFile(
        std::filesystem::path(CURVISPLAT_TEST_DATA) / "half_annulus_smooth.json", nullptr, 0, 1);
  }
  static FrameOptions options(double lod_pixels) {
    FrameOptions made;
    made.size = {160, 120};
    made.lod_pixels = lod_pixels;
    return made;
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static std::unique_ptr<CacheReader> cache_;
};

std::unique_ptr<TemporaryFolder> ProgressiveTest::folder_;
std::unique_ptr<CacheReader> ProgressiveTest::cache_;

TEST_F(ProgressiveTest, TheLastPictureIsTheFrameBitForBit) {
  FrameRenderer renderer(*cache_, 0, function());
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    FrameStatistics statistics;
    const Image direct = renderer.render(camera(projection), options(0.3), statistics);
    const uint64_t splats = statistics.splats_read;
    std::vector<Image> shown;
    std::vector<bool> finals;
    std::vector<uint64_t> read;
    renderer.renderProgressively(camera(projection), options(0.3), statistics,
                                 [&](const Image& image, bool is_final) {
                                   shown.push_back(image);
                                   finals.push_back(is_final);
                                   read.push_back(statistics.splats_read);
                                 });
    ASSERT_EQ(finals, (std::vector<bool>{false, true}));
    EXPECT_EQ(shown[1].rgba, direct.rgba);
    EXPECT_EQ(read[1], splats);
    EXPECT_LE(read[0], 100'000u);
    EXPECT_GT(read[0], 0u);
    EXPECT_LT(read[0], splats);
    EXPECT_EQ(shown[0].size.width, direct.size.width);
    EXPECT_EQ(shown[0].size.height, direct.size.height);
    EXPECT_GT(compareImages(shown[0], direct).psnr_db, 30);
  }
}

TEST_F(ProgressiveTest, WhatIsCoarseAnywayIsShownOnce) {
  FrameRenderer renderer(*cache_, 0, function());
  FrameStatistics statistics;
  const Image direct = renderer.render(camera(Projection::kOrthographic), options(100), statistics);
  int calls = 0;
  renderer.renderProgressively(camera(Projection::kOrthographic), options(100), statistics,
                               [&](const Image& image, bool is_final) {
                                 ++calls;
                                 EXPECT_TRUE(is_final);
                                 EXPECT_EQ(image.rgba, direct.rgba);
                               });
  EXPECT_EQ(calls, 1);
}

TEST_F(ProgressiveTest, WhatShowThrowsEndsTheFrame) {
  FrameRenderer renderer(*cache_, 0, function());
  FrameStatistics statistics;
  EXPECT_THROW(renderer.renderProgressively(camera(Projection::kOrthographic), options(0.3), statistics,
                                            [](const Image&, bool) { throw Error("the disk is full"); }),
               Error);
  EXPECT_NO_THROW(renderer.render(camera(Projection::kOrthographic), options(4), statistics));
}

TEST_F(ProgressiveTest, CanBeStoppedBetweenItsPicturesAndBeginsFromTheCacheOfBricks) {
  const Camera iso = camera(Projection::kOrthographic);
  FrameRenderer renderer(*cache_, 0, function());
  FrameStatistics statistics;
  int shown = 0;
  std::stop_source stop;
  FrameOptions wanted = options(0.3);
  wanted.stop = stop.get_token();
  EXPECT_THROW(renderer.renderProgressively(iso, wanted, statistics,
                                            [&](const Image&, bool) {
                                              ++shown;
                                              EXPECT_GT(statistics.bricks_read, 0u);
                                              stop.request_stop();
                                            }),
               Interrupted);
  EXPECT_EQ(shown, 1);
  const auto expectWarm = [&](const Image&, bool is_final) {
    ++shown;
    EXPECT_TRUE(is_final || statistics.bricks_read == 0);
  };
  renderer.renderProgressively(iso, options(0.3), statistics, expectWarm);
  EXPECT_EQ(shown, 3);
}

TEST_F(ProgressiveTest, ASliceOrSurfaceIsStoppedBeforeTheVolumeIsDrawn) {
  FrameRenderer renderer(*cache_, 0, function());
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->positions = {{-9, -9, 0}, {9, -9, 0}, {0, 9, 0}};
  mesh->normals.assign(3, {0, 0, 1});
  mesh->triangles = {{0, 1, 2}};
  SurfaceScene of_slice, of_surface;
  of_slice.slices.push_back({{0, 0, 0.5}, {0, 0, 1}});
  of_surface.surfaces.push_back({mesh});
  for (const SurfaceScene& scene : {of_slice, of_surface}) {
    Progress progress;
    progress.stop(15);
    FrameOptions wanted = options(0.3);
    wanted.scene = std::make_shared<SurfaceScene>(scene);
    FrameStatistics statistics;
    EXPECT_THROW(renderer.render(camera(Projection::kOrthographic), wanted, statistics, &progress),
                 Interrupted);
    progress.end();
    EXPECT_TRUE(progress.phases().empty());
  }
}

TEST_F(ProgressiveTest, MoreSplatsMakeABetterPictureAndNeverMoreThanAsked) {
  FrameRenderer renderer(*cache_, 0, function());
  FrameStatistics statistics;
  const Image whole = renderer.render(camera(Projection::kOrthographic), options(0), statistics);
  double last_db = 0;
  for (const uint64_t limit : {10'000u, 60'000u, 150'000u, 300'000u, 500'000u}) {
    FrameOptions limited = options(0);
    limited.max_splats = limit;
    const Image image = renderer.render(camera(Projection::kOrthographic), limited, statistics);
    EXPECT_LE(statistics.splats_read, limit);
    EXPECT_GT(statistics.splats_read, limit / 2);
    const double psnr_db = compareImages(image, whole).psnr_db;
    fmt::print("{} splats: {:.2f} dB\n", statistics.splats_read, psnr_db);
    EXPECT_GT(psnr_db, last_db);
    last_db = psnr_db;
  }
}

TEST_F(ProgressiveTest, ReportsHowManySplatsTheCoarsestPictureTakes) {
  FrameRenderer renderer(*cache_, 0, function());
  FrameStatistics statistics;
  FrameOptions few = options(0);
  few.max_splats = 10;
  try {
    renderer.render(camera(Projection::kOrthographic), few, statistics);
    ADD_FAILURE() << "ten splats were enough";
  } catch (const UsageError& error) {
    const std::string root = fmt::format("{}", cache_->bricks()[0].splats);
    expectSays(error.what(), root);
  }
}

/// The splats that the sweep holds when a part has entered: its splats, and of the earlier parts those behind
/// its first key.
double layerByDefinition(const std::vector<PartInRegion>& parts) {
  double largest = 0;
  for (size_t n = 0; n < parts.size(); ++n) {
    double held = 0;
    for (size_t earlier = 0; earlier <= n; ++earlier) {
      const double first = parts[earlier].keys.first, end = parts[earlier].keys.last + 1.0;
      held += parts[earlier].splats * std::clamp((end - parts[n].keys.first) / (end - first), 0.0, 1.0);
    }
    largest = std::max(largest, held);
  }
  return largest;
}

TEST(FrameRegions, TheLargestLayerIsThatOfEveryPartsEntry) {
  std::mt19937 random(3);
  for (const uint32_t longest : {1u, 1000u, 4'000'000'000u}) {
    std::vector<PartInRegion> parts;
    for (int n = 0; n < 300; ++n) {
      const auto first = static_cast<uint32_t>(random());
      const auto last = static_cast<uint32_t>(std::min<uint64_t>(first + random() % longest, UINT32_MAX));
      parts.push_back({{first, last}, static_cast<double>(random() % 1000), 0});
    }
    std::sort(parts.begin(), parts.end(),
              [](const PartInRegion& a, const PartInRegion& b) { return a.keys.first < b.keys.first; });
    const double expected = layerByDefinition(parts);
    EXPECT_NEAR(largestLayer(parts), expected, 1e-6 * expected) << longest;
  }
  EXPECT_EQ(largestLayer({}), 0);
}

class FrameRegionsTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {160, 64, 64}), *folder_ / "scene.splats");
    cache_ = std::make_unique<CacheReader>(*folder_ / "scene.splats");
  }
  static void TearDownTestSuite() {
    cache_.reset();
    folder_.reset();
  }

  static FramePlan plan(const ImageSize& size) {
    const VariableInfo& info = cache_->manifest().variables[0];
    const FramePlanner planner(*cache_,
                               DrawnScalars(0, TransferFunction::preset("cool-warm", info.min, info.max, 1)));
    FrameOptions options;
    options.size = size;
    options.lod_pixels = 0;
    const Camera camera = Camera::named("iso", cache_->manifest().lower, cache_->manifest().upper, size,
                                        Projection::kOrthographic);
    return planner.plan(camera, options);
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static std::unique_ptr<CacheReader> cache_;
};

std::unique_ptr<TemporaryFolder> FrameRegionsTest::folder_;
std::unique_ptr<CacheReader> FrameRegionsTest::cache_;

/// The bounds of a scalar that only isosurfaces are of, four floats a brick, are part of --memory.
TEST_F(FrameRegionsTest, MemoryCountsTheFurtherScalarsOfIsosurfaces) {
  const FramePlanner planner(*cache_, DrawnScalars(0, TransferFunction::preset("cool-warm", 0, 1, 1)));
  FrameOptions options;
  auto scene = std::make_shared<SurfaceScene>();
  scene->isovalues = {0.5};
  options.scene = scene;
  const uint64_t own = planner.bytes(options);
  EXPECT_EQ(own, planner.bytes({}));
  scene->further_isosurfaces = {{1, {0.5}}, {2, {0.5}}};  // planned one after the other
  EXPECT_EQ(planner.bytes(options) - own, 16 * cache_->bricks().size());
}

TEST_F(FrameRegionsTest, ThereIsOneWhereALayerFits) {
  const FramePlan whole = plan({400, 300});
  for (const size_t splats : {size_t{2} * whole.cut.splats, size_t{whole.cut.splats}}) {
    const auto regions = frameRegions(whole, *cache_, 0, splats);
    ASSERT_EQ(regions.size(), 1u) << splats;
    EXPECT_EQ(regions[0].tiles, nullptr);
    EXPECT_TRUE(regions[0].left_out.empty());
  }
}

TEST_F(FrameRegionsTest, TheyHaveEveryTileOnceAndEveryPartThatTouchesThem) {
  for (const ImageSize size : {ImageSize{400, 300}, ImageSize{1000, 40}, ImageSize{300, 300}}) {
    FramePlan whole = plan(size);
    std::vector<uint32_t> owners(TileSet::tilesOf(size, kSharedTileSide), 1);
    for (const bool of_a_rank : {false, true}) {
      if (of_a_rank) {
        for (size_t tile = 0; tile < owners.size(); ++tile)
          owners[tile] = tile % static_cast<size_t>(TileSet::tilesAlong(size.width, kSharedTileSide)) > 0;
        whole.tiles = std::make_shared<TileSet>(size, owners, 1);
      }
      const auto regions = frameRegions(whole, *cache_, 0, whole.cut.splats / 20);
      ASSERT_GT(regions.size(), 1u);
      std::vector<uint32_t> times(owners.size());
      for (const FrameRegion& region : regions) {
        ASSERT_TRUE(region.tiles);
        size_t tiles = 0;
        for (size_t tile = 0; tile < owners.size(); ++tile) tiles += region.tiles->has(tile);
        EXPECT_EQ(tiles, region.tiles->box().tiles());  // the painters rely on it
        for (size_t tile = 0; tile < owners.size(); ++tile) times[tile] += region.tiles->has(tile);
        ASSERT_EQ(region.left_out.size(), whole.parts.size());
        for (size_t n = 0; n < whole.parts.size(); ++n)
          EXPECT_EQ(region.left_out[n] == 0,
                    region.tiles->touches(
                        screenBoxOf(cache_->bricks()[whole.parts[n].part.brick], whole.settings.view)));
      }
      EXPECT_EQ(times, owners);
    }
  }
}

// A brick at a border between regions is prepared for each; one in several slabs for each slab.
TEST_F(FrameRegionsTest, FewBricksArePreparedAgain) {
  const VariableInfo& info = cache_->manifest().variables[0];
  FrameRenderer renderer(*cache_, 0, TransferFunction::preset("grey", info.min, info.max, 1), Backend::kCpu);
  FrameOptions options;
  options.size = {400, 400};
  options.lod_pixels = 0;
  options.threads = 1;
  const Camera camera = Camera::named("iso", cache_->manifest().lower, cache_->manifest().upper, options.size,
                                      Projection::kOrthographic);
  FrameStatistics statistics;
  options.memory_bytes = uint64_t{1} << 30;
  const Image expected = renderer.render(camera, options, statistics);
  EXPECT_EQ(statistics.regions, 1u);
  EXPECT_EQ(statistics.bricks_again, 0u);
  options.memory_bytes = uint64_t{72} << 20;
  EXPECT_EQ(renderer.render(camera, options, statistics).rgba, expected.rgba);
  EXPECT_GT(statistics.regions, 1u);
  EXPECT_LT(statistics.bricks_again, 2 * statistics.bricks_drawn);
}

}  // namespace
}  // namespace curvisplat
