// Frames of a converted scene: coarse ones first, and limited ones.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/frame/frame.h"
#include "stream/base/error.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/reference_march.h"
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
    EXPECT_NE(std::string(error.what()).find(root), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace curvisplat
