// Several ranks draw one picture together: rank 0 gets the bits of one process's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <memory>
#include <numeric>
#include <set>
#include <vector>

#include "preprocess/scenes/scenes.h"
#include "render/frame/frame.h"
#include "render/project/tile_set.h"
#include "render/ranks/picture_shares.h"
#include "stream/base/error.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

class SharedPicture : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    convertGrid(SceneGridSource(makeScene("half-annulus"), {80, 40, 40}), *folder_ / "scene.splats");
    scene_ = std::make_unique<CacheReader>(*folder_ / "scene.splats");
    writeRandomCache(*folder_ / "random.splats", 5, 10000);
    random_ = std::make_unique<CacheReader>(*folder_ / "random.splats");
  }
  static void TearDownTestSuite() {
    scene_.reset();
    random_.reset();
    folder_.reset();
  }

  static FrameOptions options() {
    FrameOptions made;
    made.size = {130, 90};
    made.lod_pixels = 1;
    made.threads = 2;
    return made;
  }
  static TransferFunction function(const CacheReader& cache, double unit = 0.02) {
    const VariableInfo& info = cache.manifest().variables[0];
    const double diagonal = glm::length(cache.manifest().upper - cache.manifest().lower);
    return TransferFunction::preset("cool-warm", info.min, info.max, unit * diagonal);
  }
  static Camera camera(const CacheReader& cache) {
    const Manifest& manifest = cache.manifest();
    return Camera::named("iso", manifest.lower, manifest.upper, options().size, Projection::kOrthographic,
                         30);
  }
  static Camera inside(const CacheReader& cache) {
    const Manifest& manifest = cache.manifest();
    Camera placed = camera(cache);
    placed.projection = Projection::kPerspective;
    placed.view_angle_deg = 60;
    placed.position = manifest.lower + glm::dvec3(0.2, 0.5, 0.5) * (manifest.upper - manifest.lower);
    placed.focal_point = placed.position + glm::dvec3(1, 0, 0);
    placed.view_up = {0, 0, 1};
    return placed;
  }

  struct Case {
    const CacheReader* cache;
    Camera camera;
    FrameOptions options;
    double unit = 0.02;
    Backend backend = Backend::kCpu;
  };
  struct Drawn {
    Image image;
    std::vector<FrameStatistics> statistics;  // [rank]
  };
  static Drawn draw(const Case& what, unsigned count) {
    Drawn drawn;
    drawn.statistics.resize(count);
    runRanks(count, [&](Ranks& ranks) {
      FrameRenderer renderer(*what.cache, 0, function(*what.cache, what.unit), what.backend);
      FrameOptions with = what.options;
      if (count > 1) with.ranks = &ranks;
      Image image = renderer.render(what.camera, with, drawn.statistics[ranks.rank()]);
      if (ranks.isFirst()) drawn.image = std::move(image);
    });
    return drawn;
  }
  static std::vector<unsigned> usualCounts(unsigned usual = 5) {
    return faults::isWholeSweep() ? std::vector<unsigned>{2, 3, 4, 5, 7} : std::vector<unsigned>{usual};
  }
  static void expectSameBits(const Case& what, const std::vector<unsigned>& counts = usualCounts()) {
    const Image whole = draw(what, 1).image;
    for (const unsigned count : counts) {
      const Image shared = draw(what, count).image;
      ASSERT_EQ(shared.rgba.size(), whole.rgba.size());
      EXPECT_EQ(std::memcmp(shared.rgba.data(), whole.rgba.data(), 4 * whole.rgba.size()), 0)
          << count << " ranks";
    }
  }

  static std::unique_ptr<TemporaryFolder> folder_;
  static std::unique_ptr<CacheReader> scene_, random_;
};

std::unique_ptr<TemporaryFolder> SharedPicture::folder_;
std::unique_ptr<CacheReader> SharedPicture::scene_, SharedPicture::random_;

TEST_F(SharedPicture, HasTheBitsOfOneProcess) {
  for (const CacheReader* cache : {scene_.get(), random_.get()})
    for (const Camera& view : {camera(*cache), inside(*cache)})
      expectSameBits({cache, view, options()},
                     usualCounts(view.projection == Projection::kPerspective ? 2 : 5));
}

TEST_F(SharedPicture, HasTheBitsWhereMuchIsHidden) {
  expectSameBits({scene_.get(), camera(*scene_), options(), 1e-4}, usualCounts(2));
}

TEST_F(SharedPicture, HasTheBitsWhereLayersAreMerged) {
  const TemporaryFolder folder;
  convertGrid(SceneGridSource(makeScene("boundary-layer"), {48, 40, 48}), folder / "layers.splats");
  const CacheReader layers(folder / "layers.splats");
  const Case what{&layers, camera(layers), options()};
  expectSameBits(what);
  Case finest = what;
  finest.options.lod_pixels = 0;
  EXPECT_NE(draw(what, 1).image.rgba, draw(finest, 1).image.rgba);
}

TEST_F(SharedPicture, HasTheBitsUnderALimitAndInLittleMemory) {
  FrameOptions limited = options();
  limited.max_splats = 40000;
  expectSameBits({scene_.get(), camera(*scene_), limited}, usualCounts(2));
  FrameOptions small = options();
  small.lod_pixels = 0;
  small.memory_bytes = 96 << 20;
  small.threads = 1;
  expectSameBits({scene_.get(), camera(*scene_), small});
}

// Ranks divide their tiles into regions in the least memory that is enough, each into another number of them.
TEST_F(SharedPicture, HasTheBitsWhereRanksDrawRegions) {
  const TemporaryFolder folder;
  convertGrid(SceneGridSource(makeScene("half-annulus"), {96, 48, 48}), folder / "fine.splats");
  const CacheReader fine(folder / "fine.splats");
  Case what{&fine, camera(fine), options()};
  what.options.size = {400, 300};
  what.options.lod_pixels = 0;
  what.options.threads = 1;
  const Image whole = draw(what, 1).image;
  for (const unsigned count :
       faults::isWholeSweep() ? std::vector<unsigned>{2, 5} : std::vector<unsigned>{2}) {
    Drawn shared;
    for (uint64_t mib = 32; shared.image.rgba.empty(); mib += 2) {
      ASSERT_LT(mib, 256u);
      what.options.memory_bytes = mib << 20;
      try {
        shared = draw(what, count);
      } catch (const UsageError&) {
        // There has to be more.
      }
    }
    uint64_t regions = 0;
    for (const FrameStatistics& of_rank : shared.statistics) regions = std::max(regions, of_rank.regions);
    if (count == 2) {
      EXPECT_GT(regions, 1u);
    }
    EXPECT_TRUE(shared.image.rgba == whole.rgba) << count << " ranks";
  }
}

TEST_F(SharedPicture, HasTheBitsWithLightCutsSurfacesAndSlices) {
  FrameOptions with = options();
  with.light = Light{};
  with.light->towards = Light::kShadowsFrom;
  with.light->shadow = with.light->ambient_occlusion = 0.5f;
  const Manifest& manifest = scene_->manifest();
  const glm::dvec3 middle = 0.5 * (manifest.lower + manifest.upper);
  with.clip_planes = {{middle, {0, 1, 0.3}}};
  auto scene = std::make_shared<SurfaceScene>();
  scene->slices = {{middle, {1, 0.2, 0.1}}, {middle + 0.2 * (manifest.upper - middle), {0, 0.1, 1}}};
  scene->slice_opacity = 0.6f;
  RawMesh raw;
  raw.positions = {
      manifest.lower, {manifest.upper.x, middle.y, middle.z}, {middle.x, manifest.upper.y, manifest.upper.z}};
  raw.triangles = {{0, 1, 2}};
  const auto mesh = std::make_shared<TriangleMesh>(meshOf(std::move(raw)));
  scene->surfaces.push_back({mesh, {0.8, 0.7, 0.2}});
  with.scene = scene;
  expectSameBits({scene_.get(), camera(*scene_), with}, usualCounts(3));
  expectSameBits({scene_.get(), inside(*scene_), with}, usualCounts(2));
}

TEST_F(SharedPicture, HasTheBitsWithOpenGl) {
  const TemporaryFolder folder;
  convertGrid(SceneGridSource(makeScene("half-annulus"), {40, 20, 20}), folder / "coarse.splats");
  const CacheReader coarse(folder / "coarse.splats");
  Case what{&coarse, camera(coarse), options()};
  what.backend = Backend::kOsmesa;
  expectSameBits(what, {2, 3});
}

TEST_F(SharedPicture, HasTheBitsWhereARankHasNothingToDo) {
  FrameOptions tiny = options();
  tiny.size = {40, 20};
  expectSameBits({scene_.get(), camera(*scene_), tiny}, {2, 3, 7});
}

TEST_F(SharedPicture, EachBrickIsReadByOneRank) {
  FrameOptions fine = options();
  fine.lod_pixels = 0;
  const Case what{random_.get(), camera(*random_), fine};
  const FrameStatistics whole = draw(what, 1).statistics[0];
  uint64_t bricks = 0, splats = 0, drawn = 0, largest = 0, exchanged = 0;
  for (const FrameStatistics& of_rank : draw(what, 4).statistics) {
    bricks += of_rank.bricks_read;
    splats += of_rank.splats_read;
    drawn += of_rank.splats_drawn;
    largest = std::max(largest, of_rank.splats_read);
    exchanged += of_rank.exchanged_bytes;
  }
  EXPECT_EQ(bricks, whole.bricks_read);
  EXPECT_EQ(splats, whole.splats_read);
  EXPECT_EQ(drawn, whole.splats_drawn);
  EXPECT_LT(largest, whole.splats_read / 2);
  EXPECT_GT(exchanged, 0u);
  EXPECT_LT(static_cast<double>(exchanged), 1.2 * sizeof(ScreenSplat) * static_cast<double>(drawn));
}

TEST_F(SharedPicture, AFailureOfOneRankReachesAll) {
  EXPECT_THROW(runRanks(3,
                        [&](Ranks& ranks) {
                          FrameRenderer renderer(*scene_, 0, function(*scene_), Backend::kCpu);
                          FrameOptions with = options();
                          with.ranks = &ranks;
                          if (ranks.rank() == 1) with.memory_bytes = 1 << 20;
                          FrameStatistics statistics;
                          renderer.render(camera(*scene_), with, statistics);
                        }),
               UsageError);
}

// ------------------------------------------------------------------------------------------------ tiles

std::vector<PartCost> somePartCosts(ImageSize size, unsigned seed) {
  std::vector<PartCost> parts;
  uint32_t state = seed;
  const auto random = [&](double most) {
    state = state * 1664525 + 1013904223;
    return most * (state >> 8) / (1 << 24);
  };
  for (int n = 0; n < 400; ++n) {
    const auto x = static_cast<float>(random(size.width)), y = static_cast<float>(random(size.height));
    const auto side = static_cast<float>(20 + random(60));
    parts.push_back({{x, y, x + side, y + side}, 1000, 1500, 100, 1000, 2});
  }
  return parts;
}

TEST(TileDealer, DealsEveryTileAndPartOnceAndEvenly) {
  const ImageSize size{640, 480};
  const std::vector<PartCost> parts = somePartCosts(size, 7);
  for (const uint32_t ranks : {1u, 2u, 3u, 7u, 16u, 300u, 5000u}) {
    const auto [owners, preparers] = sharePicture(parts, size, ranks);
    ASSERT_EQ(owners.size(), 4800u);
    for (const uint32_t owner : owners) ASSERT_LT(owner, ranks);
    ASSERT_EQ(preparers.size(), parts.size());
    for (const uint32_t preparer : preparers) ASSERT_LT(preparer, ranks);
    const SharedWork work = workOfRanks(parts, size, ranks);
    uint64_t pixels = 0, bricks = 0, bytes = 0;
    double sum = 0, largest = 0, prepare = 0;
    for (const RankWork& one : work.ranks) {
      pixels += one.pixels;
      bricks += one.bricks;
      bytes += one.bytes;
      prepare += one.prepare;
      sum += one.prepare + one.paint;
      largest = std::max(largest, one.prepare + one.paint);
    }
    EXPECT_EQ(pixels, size.pixels());
    EXPECT_EQ(bricks, parts.size());
    EXPECT_EQ(bytes, 100 * parts.size());
    EXPECT_GE(prepare, 1000.0 * static_cast<double>(parts.size()));
    EXPECT_GE(work.longest, largest * (1 - 1e-12));
    if (ranks <= 16) {
      EXPECT_GT(sum / ranks / largest, 0.9) << ranks;
    }
  }
}

// All splats lie in one tile, whose rank leaves preparing to the other.
TEST(PictureShares, WhoPaintsLittlePreparesMuch) {
  const std::vector<PartCost> parts(100, {{105, 105, 111, 111}, 1000, 500, 100, 1000, 2});
  double most = 0;
  for (const RankWork& one : workOfRanks(parts, {640, 480}, 2).ranks) most = std::max(most, one.prepare);
  EXPECT_GT(most, 60e3);
}

// Most parts are prepared where they are painted: little more is sent than splats at borders.
TEST(PictureShares, PartsArePreparedWhereTheyArePainted) {
  const ImageSize size{640, 480};
  std::vector<PartCost> parts;
  for (int n = 0; n < 1200; ++n) {
    const auto x = static_cast<float>(n % 4 * 160 + 20), y = static_cast<float>(n / 4 % 3 * 160 + 20);
    parts.push_back({{x, y, x + 120, y + 120}, 1000, 1500, 100, 1000, 2});
  }
  for (const uint32_t ranks : {2u, 3u, 4u}) {
    double painted = 0, received = 0;
    for (const RankWork& one : workOfRanks(parts, size, ranks).ranks) {
      painted += one.splats;
      received += one.splats_received;
    }
    EXPECT_LT(received, 0.25 * painted) << ranks;
  }
}

TEST(TileDealer, WorkOfOneRankIsTheSumOfItsParts) {
  const ImageSize size{640, 480};
  const std::vector<PartCost> parts{{{16, 16, 96, 96}, 5, 7, 11, 5, 2}, {{-96, 16, 96, 96}, 5, 8, 13, 5, 2}};
  const SharedWork work = workOfRanks(parts, size, 1), nothing = workOfRanks({}, size, 1);
  EXPECT_NEAR(work.longest - nothing.longest, 5 + 7 + 5 + 0.5 * 8,
              1e-6);  // half of the second lies in the picture
  EXPECT_EQ(work.ranks[0].bytes, 24u);
  EXPECT_EQ(work.ranks[0].bricks, 2u);
  EXPECT_NEAR(work.ranks[0].splats, 7.5, 1e-9);
  EXPECT_EQ(work.ranks[0].splats_received, 0);
}

TEST(TileDealer, SplatsNearABorderArePaintedTwice) {
  const ImageSize size{640, 480};
  const std::vector<PartCost> parts{{{0, 0, 640, 480}, 1000, 1500, 1, 1000, 3}};
  double splats = 0;
  for (const RankWork& one : workOfRanks(parts, size, 2).ranks) splats += one.splats;
  // Four pixels, with the margin, on both sides of a line of 480 pixels, or one of 640.
  EXPECT_NEAR(splats, 1000 * (1 + 8.0 / 640), 1e-6);
}

// Both sides sort the splats near a border; each pixel is painted by one rank.
TEST(TileDealer, SplatsNearABorderAreSortedTwiceButTheirPixelsPaintedOnce) {
  const ImageSize size{640, 480};
  const std::vector<PartCost> sorted{{{0, 0, 640, 480}, 0, 0, 1, 1000, 3, 1500}},
      painted{{{0, 0, 640, 480}, 0, 1500, 1, 1000, 3, 0}}, nothing{{{0, 0, 640, 480}, 0, 0, 1, 1000, 3, 0}};
  const auto paintOf = [&](const std::vector<PartCost>& parts) {
    double paint = 0;
    for (const RankWork& one : workOfRanks(parts, size, 2).ranks) paint += one.paint;
    return paint;
  };
  EXPECT_NEAR(paintOf(sorted) - paintOf(nothing), 1500 * (1 + 8.0 / 640), 1e-6);
  EXPECT_NEAR(paintOf(painted) - paintOf(nothing), 1500, 1e-6);
}

// The denser the picture, the smaller a rank's tiles are, and the more splats of its neighbours reach into them.
TEST(PictureShares, WorkIsEvenWhereNeighboursSplatsAreMuchOfIt) {
  const ImageSize size{640, 480};
  std::vector<PartCost> parts;
  for (int n = 0; n < 4000; ++n) {
    const double angle = 2.4 * n, away = 0.05 * n;
    const auto x = static_cast<float>(300 + away * std::cos(angle)),
               y = static_cast<float>(220 + away * std::sin(angle));
    parts.push_back({{x, y, x + 40, y + 40}, 1000, 500, 100, 1000, 3, 1400});
  }
  const uint32_t ranks = 64;
  const SharedWork work = workOfRanks(parts, size, ranks);
  double all = 0;
  for (const RankWork& one : work.ranks) all += one.prepare + one.paint;
  EXPECT_GT(all / ranks / work.longest, 0.91);
}

TEST(PictureShares, RoundsEndWithTheLastPartAndBecomeSmaller) {
  for (const uint32_t ranks : {1u, 2u, 7u, 512u})
    for (const size_t parts : {0u, 1u, 100u, 5000u, 20000u}) {
      const std::vector<size_t> ends = roundEnds(parts, ranks);
      ASSERT_EQ(ends.empty(), parts == 0);
      size_t before = 0, largest = parts;
      for (const size_t end : ends) {
        ASSERT_GT(end, before);
        EXPECT_LE(end - before, largest);
        largest = end - before;
        before = end;
      }
      EXPECT_EQ(before, parts);
    }
}

TEST(TileSet, TouchesWhatALookAtEveryTileFinds) {
  const ImageSize size{300, 200};
  std::vector<uint32_t> owners(TileSet::tilesOf(size, kSharedTileSide));
  for (size_t n = 0; n < owners.size(); ++n) owners[n] = (n * 7 / 3) % 5;
  const TileSet tiles(size, owners, 2);
  for (float x = -70; x < 370; x += 13)
    for (float y = -70; y < 270; y += 11)
      for (const float side : {0.0f, 5.0f, 40.0f, 200.0f}) {
        bool touches = false;
        for (int row = 0; row < tiles.rows(); ++row)
          for (int column = 0; column < tiles.columns(); ++column) {
            const auto left = static_cast<float>(column * kSharedTileSide),
                       top = static_cast<float>(row * kSharedTileSide);
            touches |= tiles.has(static_cast<size_t>(row * tiles.columns() + column)) &&
                       x <= left + kSharedTileSide && x + side >= left && y <= top + kSharedTileSide &&
                       y + side >= top;
          }
        if (touches) {
          EXPECT_TRUE(tiles.touches({x, y, x + side, y + side})) << x << " " << y << " " << side;
        }
      }
  EXPECT_FALSE(TileSet(size, owners, 9).touches({0, 0, 300, 200}));
  EXPECT_TRUE(tiles.touches({-INFINITY, -INFINITY, INFINITY, INFINITY}));
}

}  // namespace
}  // namespace curvisplat
