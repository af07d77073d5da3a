// Shadows and ambient occlusion against closed forms and the reference march: the grid of what arrives, pictures of the
// volume by both painters and at two levels, surfaces below the volume; and that a grid follows the function.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/frame/frame.h"
#include "render/mesh/triangle_mesh.h"
#include "render/project/gradient_opacity.h"
#include "render/project/projection.h"
#include "render/project/shadow_grid.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/reference_march.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

const glm::dvec3 kBox(2, 1, 1);  // from the origin, with the scalar z: extinctions are 8 z²

/// The optical depth from z to z + rise, on a ray that rises by `slope` of its length.
double depthBetween(double z, double rise, double slope) {
  const double end = z + rise;
  return slope == 0 ? 0 : 8.0 / 3 * (end * end * end - z * z * z) / slope;
}

/// The depth from a point of the box towards `towards`, as far as `reach` or `top`.
double depthFrom(const glm::dvec3& at, const glm::dvec3& towards, double reach, double top = 1) {
  const glm::dvec3 way = glm::normalize(towards);
  double length = reach;
  for (int axis = 0; axis < 3; ++axis) {
    const double upper = axis == 2 ? top : kBox[axis];
    if (way[axis] > 0) length = std::min(length, (upper - at[axis]) / way[axis]);
    if (way[axis] < 0) length = std::min(length, at[axis] / -way[axis]);
  }
  return way.z == 0 ? length * 8 * at.z * at.z : depthBetween(at.z, length * way.z, way.z);
}

class Shadows : public testing::Test {
 protected:
  void SetUp() override {
    const FunctionGridSource source({gridBlock(65, 33, 33)}, 1, [](const GridNode& node) {
      const glm::dvec3 at(static_cast<double>(node.i) / 32, static_cast<double>(node.j) / 32,
                          static_cast<double>(node.k) / 32);
      return NodeValues{at, {static_cast<float>(at.z)}};
    });
    convertGrid(source, folder_ / "box.splats");
    cache_ = std::make_unique<CacheReader>(folder_ / "box.splats");
    table_ = std::make_unique<ClassificationTable>(
        ClassificationTable::of(KnownFunction::of("smooth").table, 0, 1));
  }

  ShadowGrid gridOf(const ProjectionSettings& settings) const {
    return {*cache_,
            0,
            *table_,
            {*settings.light, settings.view.scale, settings.clip_planes, settings.gradient.get()}};
  }

  static Light lightFrom(const glm::dvec3& towards, float shadow, float ambient_occlusion = 0) {
    Light light;
    light.ambient = 1;  // colours are those of the function, but for shadows
    light.diffuse = light.specular = 0;
    light.towards = towards;
    light.shadow = shadow;
    light.ambient_occlusion = ambient_occlusion;
    return light;
  }

  /// The root mean square of the errors of a grid at points of the box: at the edges, where rays become short within a
  /// cell of the lattice, single ones are larger.
  template <typename Expected>
  static double rmsError(const ShadowGrid& grid, double top, const Expected& expected) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> part(0, 1);
    constexpr int kPoints = 2000;
    double sum = 0;
    for (int n = 0; n < kPoints; ++n) {
      const glm::dvec3 at(kBox.x * part(random), kBox.y * part(random), top * part(random));
      const double error = double{grid.at(at)} - expected(at);
      sum += error * error;
    }
    return std::sqrt(sum / kPoints);
  }

  TemporaryFolder folder_;
  std::unique_ptr<CacheReader> cache_;
  std::unique_ptr<ClassificationTable> table_;
};

TEST_F(Shadows, AreTheTransmittanceTowardsTheLight) {
  constexpr double kAll = 1e9;
  for (const glm::dvec3& towards : {glm::dvec3(0, 0, 1), {1, 0, 1}, {-1, 0.5, 2}, {2, 1, -1}, {0, -1, 0}}) {
    ProjectionSettings settings;
    settings.light = lightFrom(towards, 0.75f);
    const double error = rmsError(gridOf(settings), 1, [&](const glm::dvec3& at) {
      return 1 - 0.75 * (1 - std::exp(-depthFrom(at, towards, kAll)));
    });
    EXPECT_LT(error, 0.01) << towards.x << " " << towards.y << " " << towards.z;
  }
}

TEST_F(Shadows, AreOfWhatClipPlanesLeaveAndOfStretchedData) {
  ProjectionSettings settings;
  settings.light = lightFrom({0, 0, 1}, 1);
  settings.view.scale = {1, 1, 3};  // depths are of stretched lengths
  settings.clip_planes = {{{0, 0, 0.75}, {0, 0, -2}}};
  const double error = rmsError(gridOf(settings), 0.72, [&](const glm::dvec3& at) {
    return std::exp(-3 * depthBetween(at.z, 0.75 - at.z, 1));
  });
  EXPECT_LT(error, 0.015);
}

TEST_F(Shadows, AreOfTheVolumeThatGradientsLeave) {
  ProjectionSettings settings;
  settings.light = lightFrom({0, 0, 1}, 1);
  const std::vector<OpacityPoint> half{{0, 0.5}, {1, 0.5}};
  settings.gradient =
      std::make_shared<const GradientOpacity>(half, GradientPercentiles(*cache_, 0, glm::dvec3(1)));
  const double error = rmsError(gridOf(settings), 1, [&](const glm::dvec3& at) {
    return std::exp(-0.5 * depthBetween(at.z, 1 - at.z, 1));
  });
  EXPECT_LT(error, 0.01);
}

TEST_F(Shadows, OfTheSurroundingsAreTheMeanTransmittance) {
  ProjectionSettings settings;
  settings.light = lightFrom({0, 0, 1}, 0, 0.5f);
  const double reach = glm::length(kBox) / 8;
  const double error = rmsError(gridOf(settings), 1, [&](const glm::dvec3& at) {
    double sum = 0;
    for (const double x : {-1, 0, 1})
      for (const double y : {-1, 0, 1})
        for (const double z : {-1, 0, 1}) {
          const double squared = x * x + y * y + z * z;
          if (squared == 1 || squared == 3) sum += std::exp(-depthFrom(at, {x, y, z}, reach));
        }
    return 1 - 0.5 * (1 - sum / 14);
  });
  EXPECT_LT(error, 0.005);
}

TEST_F(Shadows, HaveTheSameBitsWithAnyThreads) {
  ProjectionSettings settings;
  settings.light = lightFrom({-1, 0.5, 2}, 0.75f, 0.5f);
  const auto by = [&](int threads) {
    std::vector<float> values;
    tbb::task_arena(threads).execute([&] {
      const ShadowGrid grid = gridOf(settings);
      for (int n = 0; n < 1000; ++n) values.push_back(grid.at(kBox * (n / 1000.0)));
    });
    return values;
  };
  EXPECT_EQ(by(1), by(2));
}

TEST_F(Shadows, FollowTheFunctionTheLightAndTheCuts) {
  FrameOptions options = knownFrame({40, 40});
  options.light = lightFrom({-1, 0.5, 2}, 0.75f);
  const Camera camera =
      Camera::named("iso", glm::dvec3(0), kBox, options.size, Projection::kOrthographic, 30);
  const TransferFunction other = KnownFunction::of("band").table;
  FrameRenderer kept(*cache_, 0, KnownFunction::of("smooth").table, Backend::kCpu);
  FrameStatistics statistics;
  const auto expectTheSame = [&](const char* what) {
    FrameRenderer fresh(*cache_, 0, other, Backend::kCpu);
    EXPECT_TRUE(kept.render(camera, options, statistics).rgba ==
                fresh.render(camera, options, statistics).rgba)
        << what;
  };
  kept.render(camera, options, statistics);
  kept.setTransferFunction(other);
  expectTheSame("function");
  options.light->towards = glm::dvec3(1, 0, 0);
  expectTheSame("direction");
  options.light->shadow = 0.25f;
  expectTheSame("shadow");
  options.light->ambient_occlusion = 0.5f;
  expectTheSame("ambient occlusion");
  options.clip_planes = {{{0, 0, 0.5}, {0, 0, -1}}};
  expectTheSame("clip plane");
  options.gradient_opacity = {{0, 0.5}, {1, 0.5}};
  expectTheSame("gradient opacity");
  options.scale = {1, 1, 2};
  expectTheSame("scale");
}

TEST_F(Shadows, DarkenSurfacesAndIsosurfacesAndLeaveSlices) {
  FrameOptions options = knownFrame({40, 40});
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    const Camera camera = Camera::named("+z", glm::dvec3(0), kBox, options.size, projection, 30);
    const auto darkness = [&](const std::shared_ptr<SurfaceScene>& scene) {
      scene->volume = false;
      options.scene = scene;
      FrameRenderer renderer(*cache_, 0, KnownFunction::of("smooth").table, Backend::kCpu);
      FrameStatistics statistics;
      const auto greenBy = [&](float shadow) {
        options.light = lightFrom({0, 0, 1}, shadow);
        return renderer.render(camera, options, statistics).rgba[4 * (20 * 40 + 20) + 1];
      };
      return double{greenBy(0.75f)} / double{greenBy(0)};
    };
    const auto expected = [](double z) { return 1 - 0.75 * (1 - std::exp(-depthBetween(z, 1 - z, 1))); };
    RawMesh raw;
    raw.positions = {{0, 0, 0.5}, {2, 0, 0.5}, {2, 1, 0.5}, {0, 1, 0.5}};
    raw.triangles = {{0, 1, 2}, {0, 2, 3}};
    auto scene = std::make_shared<SurfaceScene>();
    scene->surfaces.push_back({std::make_shared<TriangleMesh>(meshOf(std::move(raw))), {0.8, 0.7, 0.2}});
    EXPECT_NEAR(darkness(scene), expected(0.5), 0.01);
    scene = std::make_shared<SurfaceScene>();
    scene->isovalues = {0.625};
    EXPECT_NEAR(darkness(scene), expected(0.625), 0.01);
    scene = std::make_shared<SurfaceScene>();
    scene->slices = {{{0, 0, 0.5}, {0, 0, 1}}};
    EXPECT_NEAR(darkness(scene), 1, 1e-6);
  }
}

TEST_F(Shadows, AreThoseOfTheReferenceMarch) {
  constexpr ImageSize kSize{48, 48};
  const auto scene = makeScene("half-annulus");
  const SceneField field(*scene);
  convertGrid(SceneGridSource(scene, {96, 48, 48}, 4), folder_ / "annulus.splats");
  const CacheReader cache(folder_ / "annulus.splats");
  const KnownFunction function = KnownFunction::of("smooth");
  struct Row {
    const char* name;
    float shadow, ambient_occlusion;
    double least_db, most_db_without;
  };
  for (const Row& row : {Row{"shadow", 0.9f, 0, 45, 30}, Row{"ambient occlusion", 0, 0.9f, 45, 30}}) {
    FrameOptions options = knownFrame(kSize);
    options.light = lightFrom({1, -1, 2}, row.shadow, row.ambient_occlusion);
    ReferenceLight light;
    light.ambient = 1;
    light.diffuse = light.specular = 0;
    light.towards = options.light->towards;
    light.shadow = double{row.shadow};
    light.ambient_occlusion = double{row.ambient_occlusion};
    light.occlusion_reach = glm::length(cache.manifest().upper - cache.manifest().lower) / 8;
    light.shadow_step = row.shadow > 0 ? 0.02 : 0.04;
    MarchSteps steps;
    steps.step = 0.03;
    steps.tolerance = 1e-3;
    steps.every = faults::isWholeSweep() ? 1 : 2;
    const Image reference =
        toImage(referenceMarch(field, function.exact, halfAnnulusCamera(), kSize, steps, {&light}));
    for (const double lod_pixels : {0.0, 4.0}) {
      options.lod_pixels = lod_pixels;
      const auto draw = [&](Backend backend, const std::optional<Light>& lit) {
        options.light = lit;
        FrameRenderer renderer(cache, 0, function.table, backend);
        FrameStatistics statistics;
        return renderer.render(halfAnnulusCamera(), options, statistics);
      };
      const std::optional<Light> lit = options.light;
      const Image drawn = draw(Backend::kCpu, lit);
      const double on_db = compareWithReference(drawn, reference).psnr_db,
                   off_db = compareWithReference(draw(Backend::kCpu, std::nullopt), reference).psnr_db;
      fmt::print("{} at {} pixels: {:.1f} dB, without {:.1f} dB\n", row.name, lod_pixels, on_db, off_db);
      EXPECT_GE(on_db, row.least_db) << row.name << lod_pixels;
      EXPECT_LT(off_db, row.most_db_without) << row.name << lod_pixels;
      // It takes OpenGL seconds on the processor to draw a quarter of a million splats.
      if (lod_pixels > 0 || faults::isWholeSweep()) {
        EXPECT_GE(compareImages(draw(Backend::kOsmesa, lit), drawn).psnr_db, 60) << row.name << lod_pixels;
      }
      options.light = lit;
    }
  }
}

TEST_F(Shadows, ADamagedBrickIsAnErrorOrLeftOutAndNamed) {
  const ProjectionSettings settings = [] {
    ProjectionSettings made;
    made.light = lightFrom({0, 0, 1}, 1);
    return made;
  }();
  EXPECT_TRUE(gridOf(settings).damaged().empty());
  {
    std::fstream file(cache_->geometryPath(), std::ios::in | std::ios::out | std::ios::binary);
    for (const Brick& brick : cache_->bricks()) {
      file.seekp(static_cast<std::streamoff>(brick.geometry.offset));
      file.put('\x55').put('\x5a').put('\xa5');
    }
  }
  cache_ = std::make_unique<CacheReader>(folder_ / "box.splats");
  EXPECT_THROW(gridOf(settings), DamagedBrick);
  ShadowScene scene;
  scene.light = *settings.light;
  scene.leave_out_damaged = true;
  const ShadowGrid grid(*cache_, 0, *table_, scene);
  ASSERT_FALSE(grid.damaged().empty());
  EXPECT_NE(grid.damaged().front().second, "");
  EXPECT_EQ(grid.at(0.5 * kBox), 1);  // nothing is left that casts a shadow
}

}  // namespace
}  // namespace curvisplat
