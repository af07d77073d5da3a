#include "render/hidden_bricks.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "render/cpu_painter.h"
#include "render/frame.h"
#include "render/kernel.h"
#include "stream/file.h"
#include "tests/support/lattice_cache.h"
#include "tests/support/random_cache.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

Camera cameraFrom(const glm::dvec3& position, const glm::dvec3& focal_point, Projection projection) {
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
  for (const Projection projection : {Projection::orthographic, Projection::perspective})
    for (const double distance : {80.0, 30.0, 12.0}) {
      const Camera camera = cameraFrom(middle + distance * glm::dvec3(0.6, 0.64, 0.48), middle, projection);
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
  const Camera camera = cameraFrom(middle + glm::dvec3(80, 0, 0), middle, Projection::orthographic);
  HiddenBricks hidden;
  const ScreenView view = ScreenView::of(camera, {100, 100}, glm::dvec3(1), 1.5, 1);
  hidden.begin(cache.bricks(), view);
  EXPECT_FALSE(hidden.hides(0));
  CpuPainter painter;
  painter.begin({100, 100}, glm::vec4(1), table, true, {1, 1});
  hidden.ask(&painter);
  EXPECT_FALSE(hidden.hides(0));
  const std::vector<ScreenSplat> walls(2, {50, 50, 1e4f, 0, 1e4f, 1e4f, 0.5f, 0, 0, 0});
  painter.draw(walls);
  for (uint32_t id = 0; id < cache.bricks().size(); ++id) EXPECT_TRUE(hidden.hides(id)) << id;
  hidden.begin(cache.bricks(), view);
  EXPECT_FALSE(hidden.hides(0));
}

// Opaque splats, and as little memory as renders at all: most bricks are hidden before they are read. However
// much is left out, the picture has the same bits.
TEST_F(HiddenBricksTest, FramesAreTheSameHoweverMuchIsLeftOut) {
  writeRandomCache(folder_ / "a.splats", 3, 20000);
  const CacheReader cache(folder_ / "a.splats");
  const Manifest& manifest = cache.manifest();
  const auto opaque = TransferFunction::preset("viridis", -1, 1, 1e-6);
  FrameOptions options;
  options.size = {60, 50};
  options.lod_pixels = 0;
  const Camera camera =
      Camera::named("iso", manifest.lower, manifest.upper, options.size, Projection::orthographic);
  FrameStatistics statistics;
  FrameRenderer renderer(cache, 0, opaque, Backend::cpu);
  options.memory_bytes = uint64_t{2} << 30;
  const Image whole = renderer.render(camera, options, statistics);
  const uint64_t parts = statistics.bricks_drawn + statistics.bricks_hidden;
  for (const unsigned threads : {1u, 2u})
    for (const uint64_t memory : {uint64_t{64} << 20, uint64_t{512} << 20}) {
      options.threads = threads;
      options.memory_bytes = memory;
      EXPECT_EQ(renderer.render(camera, options, statistics).rgba, whole.rgba) << threads << ' ' << memory;
      EXPECT_EQ(statistics.bricks_drawn + statistics.bricks_hidden, parts);
    }
  // Prepared ahead are a batch, the ring and what a worker holds.
  options.threads = 1;
  options.memory_bytes = uint64_t{48} << 20;
  FrameRenderer small(cache, 0, opaque, Backend::cpu);
  EXPECT_EQ(small.render(camera, options, statistics).rgba, whole.rgba);
  EXPECT_GT(statistics.bricks_hidden, parts / 3);
  EXPECT_GT(statistics.bricks_left_out, parts / 4);
  EXPECT_GT(statistics.bytes_left_out, statistics.bytes_read / 4);
  EXPECT_EQ(statistics.bricks_left_out + statistics.bricks_read + statistics.bricks_cached, parts);

  const Image by_gl = FrameRenderer(cache, 0, opaque, Backend::osmesa).render(camera, options, statistics);
  EXPECT_EQ(statistics.bricks_hidden + statistics.splats_hidden + statistics.bricks_left_out, 0u);
  EXPECT_GT(compareImages(whole, by_gl).psnr_db, 55);  // edges are as sharp as a pixel
}

}  // namespace
}  // namespace curvisplat
