#include "render/sweep/hidden_bricks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "render/cpu/cpu_painter.h"
#include "render/frame/frame.h"
#include "render/frame/frame_workers.h"
#include "render/project/footprint.h"
#include "stream/base/file.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

Camera cameraLookingAt(const glm::dvec3& position, const glm::dvec3& focal_point, Projection projection) {
  Camera camera;
  camera.position = position;
  camera.focal_point = focal_point;
  camera.view_up = {0, 0, 1};
  camera.projection = projection;
  camera.parallel_scale = 24;
  camera.view_angle_deg = 60;
  return camera;
}

TransferFunction grey() {
  return TransferFunction::preset("grey", 0, 1, 1.0);
}

class HiddenBricksTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
};

TEST_F(HiddenBricksTest, BoxesHoldAllFootprints) {
  writeLatticeCache(folder_ / "lattice.splats", 0, {0.02, 0.01, 0});
  const CacheReader cache(folder_ / "lattice.splats");
  const auto table = ClassificationTable::of(grey(), 0, 1);
  const glm::dvec3 middle(0.5 * kLatticeSide);
  BrickProjector projector;
  SplatGeometry geometry;
  SplatVariable variable;
  int bounded = 0;
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective})
    for (const double distance : {80.0, 30.0, 12.0}) {
      const Camera camera =
          cameraLookingAt(middle + distance * glm::dvec3(0.6, 0.64, 0.48), middle, projection);
      for (const glm::dvec3& scale : {glm::dvec3(1), glm::dvec3(1, 2, 0.5)}) {
        const ProjectionSettings settings{ScreenView::of(camera, {120, 100}, scale, 1.5, 0.01)};
        for (uint32_t id = 0; id < cache.bricks().size(); ++id) {
          const Brick& brick = cache.bricks()[id];
          cache.readGeometry(id, geometry);
          cache.readVariable(id, 0, variable);
          projector.project(settings, table, cache.manifest().root.cellMin(brick.cell), geometry, variable);
          const ScreenBox box = screenBoxOf(brick, settings.view);
          bounded += std::isfinite(box.x0);
          for (const ScreenSplat& splat : projector.splats()) {
            const auto reach_x = static_cast<float>(kKernelSupport) * splat.l11;
            const auto reach_y = static_cast<float>(kKernelSupport) * std::hypot(splat.l21, splat.l22);
            ASSERT_LE(box.x0, splat.x - reach_x) << id << ' ' << distance;
            ASSERT_GE(box.x1, splat.x + reach_x) << id << ' ' << distance;
            ASSERT_LE(box.y0, splat.y - reach_y) << id << ' ' << distance;
            ASSERT_GE(box.y1, splat.y + reach_y) << id << ' ' << distance;
          }
        }
      }
    }
  EXPECT_GT(bounded, 600);
}

TEST_F(HiddenBricksTest, NothingIsHiddenBeforeAPainterAnswers) {
  writeLatticeCache(folder_ / "lattice.splats", 0, {0.02, 0.01, 0});
  const CacheReader cache(folder_ / "lattice.splats");
  const auto table = ClassificationTable::of(grey(), 0, 1);
  const glm::dvec3 middle(0.5 * kLatticeSide);
  const Camera camera = cameraLookingAt(middle + glm::dvec3(80, 0, 0), middle, Projection::kOrthographic);
  HiddenBricks hidden;
  const ScreenView view = ScreenView::of(camera, {100, 100}, glm::dvec3(1), 1.5, 1);
  hidden.begin(cache.bricks(), view);
  EXPECT_FALSE(hidden.hides(0));
  CpuPainter painter;
  painter.begin({100, 100}, glm::vec4(1), table, {}, {1, 1});
  hidden.ask(&painter);
  EXPECT_FALSE(hidden.hides(0));
  const std::vector<ScreenSplat> walls(2, {50, 50, 1e4f, 0, 1e4f, 1e4f, 0.5f, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  painter.draw(walls);
  for (uint32_t id = 0; id < cache.bricks().size(); ++id) EXPECT_TRUE(hidden.hides(id)) << id;
  hidden.begin(cache.bricks(), view);
  EXPECT_FALSE(hidden.hides(0));
}

/// Says that the left half of the screen is hidden, and what lies outside of it.
class HalfHidden final : public Painter {
 public:
  void begin(ImageSize, const glm::vec4&, const ClassificationTable&, PixelShading,
             const PaintResources&) override {}
  void drawOnly(const TileSet&) override {}
  void draw(std::span<const ScreenSplat>) override {}
  bool hides(const ScreenBox& box) const override { return box.x1 < 30; }
  Image end() override { return Image(); }
  double uploadSeconds() const override { return 0; }
  double drawSeconds() const override { return 0; }
};

TEST_F(HiddenBricksTest, WorkersPassOverWhatIsHiddenAndThePagerDoesNotReadIt) {
  writeRandomCache(folder_ / "a.splats");
  const CacheReader cache(folder_ / "a.splats");
  const Manifest& manifest = cache.manifest();
  const auto table = ClassificationTable::of(grey(), -1, 1);
  const ImageSize size{60, 50};
  const Camera camera = Camera::named("-y", manifest.lower, manifest.upper, size, Projection::kOrthographic);
  const ProjectionSettings settings{ScreenView::of(camera, size, glm::dvec3(1), 1.5, 1)};
  const DepthKeys keys(settings.view, manifest.root);
  std::vector<BrickPart> parts;
  std::vector<SweptPart> swept;
  uint64_t expected_hidden = 0, expected_bytes = 0;
  for (uint32_t id = 0; id < cache.bricks().size(); ++id) {
    parts.push_back({id});
    swept.push_back({{id}, keys.rangeOf(cache.bricks()[id])});
    swept.back().keys.first = 0;  // in any order, then
    if (screenBoxOf(cache.bricks()[id], settings.view).x1 >= 30) continue;
    ++expected_hidden;
    expected_bytes += cache.bricks()[id].geometry.length + cache.brickVariables(0)[id].values.length;
  }
  ASSERT_GT(expected_hidden, 10u);
  ASSERT_LT(expected_hidden, parts.size() - 10);

  const HalfHidden painter;
  HiddenBricks hidden;
  hidden.begin(cache.bricks(), settings.view);
  hidden.ask(&painter);
  for (const bool before_reading : {false, true}) {
    BrickSource source(cache, 0, {}, 0);
    std::vector<ScreenSplat> memory(3 * BrickProjector::kMaxSplats);
    SegmentRing ring(memory);
    SweepBuffer sweep(1'000'000, 50'000);
    ComputePermits permits(2);
    FrameWorkers workers(source, sweep, ring, permits, 2);
    BrickPager::Unneeded unneeded;
    if (before_reading) unneeded = [&](uint32_t brick) { return hidden.hides(brick); };
    source.start(parts, unneeded);
    const FrameWork work{cache, swept, settings, table, keys, hidden};
    workers.beginFrame(work);
    ASSERT_TRUE(sweep.beginSlab(swept));
    workers.start(nullptr);
    uint64_t drawn = 0;
    while (const auto segment = ring.next()) {
      drawn += segment->size();
      ring.release();
    }
    FrameStatistics statistics;
    workers.finish(statistics);
    source.finish(statistics);
    EXPECT_EQ(drawn, statistics.splats_drawn);
    EXPECT_EQ(workers.partsHidden(), expected_hidden);
    EXPECT_EQ(workers.partsSeen(), parts.size());
    EXPECT_EQ(statistics.bricks_left_out, before_reading ? expected_hidden : 0);
    EXPECT_EQ(statistics.bytes_left_out, before_reading ? expected_bytes : 0);
    EXPECT_GT(statistics.splats_drawn, 0u);
  }
}

// Opaque splats, which hide more or less depending on memory and threads: the picture has the same bits.
TEST_F(HiddenBricksTest, FramesAreTheSameHoweverMuchIsLeftOut) {
  writeRandomCache(folder_ / "a.splats", 3, 20000);
  const CacheReader cache(folder_ / "a.splats");
  const Manifest& manifest = cache.manifest();
  const auto opaque = TransferFunction::preset("viridis", -1, 1, 1e-6);
  FrameOptions options;
  options.size = {200, 160};
  options.lod_pixels = 0;
  options.low_pass_px2 = 1.5;  // few splats a pixel: wide ones, that leave no gap
  const Camera camera =
      Camera::named("iso", manifest.lower, manifest.upper, options.size, Projection::kOrthographic);
  FrameStatistics statistics;
  FrameRenderer renderer(cache, 0, opaque, Backend::kCpu);
  const Image whole = renderer.render(camera, options, statistics);
  const uint64_t parts = statistics.bricks_drawn + statistics.bricks_hidden;
  for (const unsigned threads : {1u, 2u})
    for (const uint64_t memory : {uint64_t{56} << 20, uint64_t{2} << 30}) {
      options.threads = threads;
      options.memory_bytes = memory;
      EXPECT_EQ(renderer.render(camera, options, statistics).rgba, whole.rgba) << threads << ' ' << memory;
      EXPECT_EQ(statistics.bricks_drawn + statistics.bricks_hidden, parts);
      EXPECT_GT(statistics.bricks_hidden + statistics.splats_hidden, 0u);
    }
  const Image by_gl = FrameRenderer(cache, 0, opaque, Backend::kOsmesa).render(camera, options, statistics);
  EXPECT_EQ(statistics.bricks_hidden + statistics.splats_hidden + statistics.bricks_left_out, 0u);
  EXPECT_GT(compareImages(whole, by_gl).psnr_db, 55);  // edges are as sharp as a pixel
}

}  // namespace
}  // namespace curvisplat
