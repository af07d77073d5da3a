#include <gtest/gtest.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "render/project/depth_sort.h"
#include "render/project/projection.h"
#include "render/project/tile_key.h"
#include "stream/cache/cache_reader.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

ScreenView viewFrom(const glm::dvec3& position, Projection projection, const glm::dvec3& scale) {
  Camera camera;
  camera.position = position;
  camera.focal_point = glm::dvec3(16);
  camera.view_up = {0, 0, 1};
  camera.projection = projection;
  camera.parallel_scale = 24;
  camera.view_angle_deg = 60;
  return ScreenView::of(camera, {120, 100}, scale, 1.5, 0.01);
}

class DepthKeysTest : public testing::Test {
 protected:
  DepthKeysTest() {
    writeLatticeCache(folder_ / "lattice.splats", 0, {0.02, 0.01, 0});
    cache_ = std::make_unique<CacheReader>(folder_ / "lattice.splats");
  }

  TemporaryFolder folder_;
  std::unique_ptr<CacheReader> cache_;
};

/// A splat at the middle of the picture that leans by so many pixels of depth a pixel.
ScreenSplat leaningSplat(float x, float y) {
  ScreenSplat splat{60, 50, 3, 0, 2, 1, 0, 0, 0, 0, 0, 0, 0, 0, x, y};
  return splat;
}

// Keys are compared with depths in double precision: no two splats that differ by more than rounding change
// places, and holding keys within their brick's range moves none.
TEST_F(DepthKeysTest, AreInTheOrderOfTheDepths) {
  std::mt19937 random(3);
  const RootCube& root = cache_->manifest().root;
  for (const glm::dvec3& scale : {glm::dvec3(1), glm::dvec3(1, 2, 0.5)})
    for (const glm::dvec3& position : {glm::dvec3(90, 20, 30), glm::dvec3(-20, 16, 16), glm::dvec3(5, 6, 7)})
      for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
        const ScreenView view = viewFrom(position, projection, scale);
        const bool perspective = projection == Projection::kPerspective;
        const DepthKeys made(view, root);
        std::vector<std::pair<double, uint32_t>> keyed;
        for (const Brick& brick : cache_->bricks()) {
          const glm::dvec3 corner = root.cellMin(brick.cell);
          const KeyRange range = made.rangeOf(brick);
          ASSERT_LE(range.first, range.last);
          std::vector<float> depths;
          std::vector<double> exact;
          while (depths.size() < 50) {
            const glm::dvec3 part(random() / 4294967295.0, random() / 4294967295.0, random() / 4294967295.0);
            const double z = view.viewFromData(glm::mix(brick.lower, brick.upper, part)).z;
            if (perspective && z < view.near) {
              if (view.viewFromData(brick.upper).z < view.near) break;
              continue;
            }
            exact.push_back(z);
            depths.push_back(static_cast<float>(perspective ? 1 / view.orderBase(corner) - 1 / z
                                                            : z - view.viewFromData(corner).z));
          }
          std::vector<ScreenSplat> splats(depths.size(), leaningSplat(0, 0));
          std::vector<uint32_t> keys(depths.size()), free(depths.size());
          made.setKeys(splats, depths, corner, {0, ~uint32_t{0}}, free);
          made.setKeys(splats, depths, corner, range, keys);
          EXPECT_EQ(keys, free);
          for (size_t n = 0; n < keys.size(); ++n) {
            EXPECT_EQ(splats[n].key, keys[n]);
            EXPECT_EQ(splats[n].first, keys[n]);
            keyed.push_back({exact[n], keys[n]});
          }
        }
        std::sort(keyed.begin(), keyed.end());
        double nearest_before = 0;
        uint32_t most = 0;
        for (const auto& [depth, key] : keyed) {
          if (key < most) {
            EXPECT_LT(depth - nearest_before, 1e-4) << depth;
          }
          if (key >= most) {
            most = key;
            nearest_before = depth;
          }
        }
      }
}

TEST_F(DepthKeysTest, StayInTheirBricksRangeWhateverTheDepth) {
  const RootCube& root = cache_->manifest().root;
  const Brick& brick = cache_->bricks()[40];
  const std::vector<float> depths{-1e30f, 0.0f, 1e30f, std::numeric_limits<float>::quiet_NaN(), INFINITY};
  std::vector<uint32_t> keys(depths.size());
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective})
    for (const float slope : {0.0f, 5.0f}) {
      const DepthKeys made(viewFrom({90, 20, 30}, projection, glm::dvec3(1)), root);
      const KeyRange range = made.rangeOf(brick);
      std::vector<ScreenSplat> splats(depths.size(), leaningSplat(slope, slope));
      made.setKeys(splats, depths, root.cellMin(brick.cell), range, keys);
      for (const uint32_t key : keys) {
        EXPECT_GE(key, range.first);
        EXPECT_LE(key, range.last);
      }
      // What does not lean is painted as it comes: by its first key.
      for (const ScreenSplat& splat : splats) EXPECT_TRUE(leans(splat) || splat.key == splat.first);
    }
}

// A splat has in each tile that it touches the depth at which its plane meets the tile's middle; and it is
// taken before all of those.
TEST_F(DepthKeysTest, ASplatThatLeansHasItsPlanesDepthInEveryTile) {
  const RootCube& root = cache_->manifest().root;
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    const ScreenView view = viewFrom({90, 20, 30}, projection, glm::dvec3(1));
    const bool perspective = projection == Projection::kPerspective;
    const DepthKeys made(view, root);
    const glm::dvec3 corner = root.cellMin(cache_->bricks()[40].cell), centre = corner + glm::dvec3(0.5);
    const glm::dvec3 at = view.viewFromData(centre);
    const glm::dvec2 pixel = view.pixelFromView(at);
    // z grows by a (x - x0) + b (y - y0), all in view axes.
    const double a = 0.7, b = -1.6;
    const auto depthAt = [&](const glm::dvec2& where) {
      const glm::dvec2 from_middle =
          (where - 0.5 * glm::dvec2(view.size.width, view.size.height)) / view.focal_px;
      if (!perspective) return at.z + a * (from_middle.x - at.x) + b * (from_middle.y - at.y);
      return (at.z - a * at.x - b * at.y) / (1 - a * from_middle.x - b * from_middle.y);
    };
    const double step = 1e-4;
    const double z_pixels = view.focal_px / (perspective ? at.z : 1);
    ScreenSplat splat =
        leaningSplat(static_cast<float>((depthAt(pixel + glm::dvec2(step, 0)) - at.z) / step * z_pixels),
                     static_cast<float>((depthAt(pixel + glm::dvec2(0, step)) - at.z) / step * z_pixels));
    splat.x = static_cast<float>(pixel.x);
    splat.y = static_cast<float>(pixel.y);
    const auto keyOfDepth = [&](double z) {
      ScreenSplat flat = leaningSplat(0, 0);
      const float depth = static_cast<float>(perspective ? 1 / view.orderBase(corner) - 1 / z
                                                         : z - view.viewFromData(corner).z);
      uint32_t key = 0;
      made.setKeys({&flat, 1}, {&depth, 1}, corner, {0, ~uint32_t{0}}, {&key, 1});
      return key;
    };
    const float depth = static_cast<float>(perspective ? 1 / view.orderBase(corner) - 1 / at.z
                                                       : at.z - view.viewFromData(corner).z);
    uint32_t first = 0;
    made.setKeys({&splat, 1}, {&depth, 1}, corner, {0, ~uint32_t{0}}, {&first, 1});
    EXPECT_LT(first, splat.key);
    int tiles = 0;
    for (int y = -16; y <= 16; y += kOrderSide)
      for (int x = -16; x <= 16; x += kOrderSide) {
        const glm::dvec2 middle = pixel + glm::dvec2(x, y);
        const uint32_t key = keyAt(splat, static_cast<float>(middle.x), static_cast<float>(middle.y));
        EXPECT_GE(key, first);
        const double expected = keyOfDepth(depthAt(middle));
        // Farther away than the splat reaches, or than the data.
        if (key == first || key >= keyOfDepth(1e6)) continue;
        EXPECT_NEAR(key, expected, 2e-3 * std::abs(expected - splat.key) + 200) << x << ' ' << y;
        ++tiles;
      }
    EXPECT_GT(tiles, 10);
  }
}

// Thin cells that are smaller than a pixel lean over whole tiles, much farther than they reach.
TEST_F(DepthKeysTest, RangesHoldWhatSmallSplatsLean) {
  Camera camera;
  camera.position = {90, 20, 80};
  camera.focal_point = {16, 16, 1};
  camera.view_up = {0, 0, 1};
  camera.projection = Projection::kOrthographic;
  camera.parallel_scale = 1000;
  const ProjectionSettings settings{ScreenView::of(camera, {120, 100}, {1, 1, 0.05}, 0.3, 0.001)};
  const auto table = ClassificationTable::of(TransferFunction::preset("grey", 0, 1, 1.0), 0, 1);
  const DepthKeys made(settings.view, cache_->manifest().root);
  BrickProjector projector;
  SplatGeometry geometry;
  SplatVariable values;
  uint64_t before = 0;  // of keys, those less than their centres'
  for (uint32_t id = 0; id < cache_->bricks().size(); ++id) {
    const Brick& brick = cache_->bricks()[id];
    const glm::dvec3 corner = cache_->manifest().root.cellMin(brick.cell);
    cache_->readGeometry(id, geometry);
    cache_->readVariable(id, 0, values);
    projector.project(settings, table, corner, geometry, values);
    std::vector<uint32_t> held(projector.depths().size()), free(held.size());
    std::vector<ScreenSplat> splats = projector.splats();
    made.setKeys(splats, projector.depths(), corner, {0, ~uint32_t{0}}, free);
    made.setKeys(projector.mutableSplats(), projector.depths(), corner, made.rangeOf(brick), held);
    EXPECT_EQ(held, free) << id;
    for (const ScreenSplat& splat : splats) before += leans(splat) && splat.first < splat.key;
  }
  EXPECT_GT(before, 1000u);
}

// The first key of a splat is the least that the tiles of its rectangle have, or that of a tile whose corner its ellipse
// touches, whichever is more: both are at most the least of the tiles that it touches.
TEST(TileKey, FirstIsTheLeastThatRectangleAndEllipseAllow) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0, 1), around(-1, 1);
  constexpr double kSupport = kKernelSupport, kHalf = 0.5 * kOrderSide;
  int by_ellipse = 0, by_rectangle = 0, later = 0, single = 0;
  for (int n = 0; n < 5000; ++n) {
    ScreenSplat splat{};
    splat.x = 100 * unit(random);
    splat.y = 70 * unit(random);
    splat.l11 = 0.2f + 6 * unit(random) * unit(random);
    splat.l21 = 4 * around(random);
    splat.l22 = 0.2f + 3 * unit(random);
    if (n % 4 == 0) splat.l11 *= 0.1f, splat.l21 *= 0.1f, splat.l22 *= 0.1f;
    const uint32_t key = splat.key = 1000000;
    const double s0 = splat.key_slope0 = 300 * around(random), s1 = splat.key_slope1 = 300 * around(random);
    const double reach_x = kSupport * splat.l11, reach_y = kSupport * std::hypot(splat.l21, splat.l22);
    double least = INFINITY;
    int tiles = 0;
    const auto tileOf = [](double at) { return std::floor(at / kOrderSide); };
    for (double row = tileOf(splat.y - reach_y); row <= tileOf(splat.y + reach_y); ++row)
      for (double column = tileOf(splat.x - reach_x); column <= tileOf(splat.x + reach_x); ++column, ++tiles)
        least = std::min(least, key + s0 * (column * kOrderSide + kHalf - splat.x) +
                                    s1 * (row * kOrderSide + kHalf - splat.y));
    const double of_ellipse = key - kSupport * std::hypot(s0 * splat.l11 + s1 * splat.l21, s1 * splat.l22) -
                              kHalf * (std::abs(s0) + std::abs(s1));
    setFirst(splat);
    EXPECT_NEAR(splat.first, std::max(least, of_ellipse), 3) << n;
    by_ellipse += of_ellipse > least + 100;
    by_rectangle += least > of_ellipse + 100;
    later += least > key + 10;
    EXPECT_EQ(leans(splat), tiles > 1) << n;
    if (tiles > 1) continue;
    EXPECT_EQ(splat.key, splat.first) << n;
    ++single;
  }
  EXPECT_GT(by_ellipse, 100);
  EXPECT_GT(by_rectangle, 100);
  EXPECT_GT(later, 100);
  EXPECT_GT(single, 100);
}

// Splats that are cut into pieces still have depths of their own.
TEST_F(DepthKeysTest, RangesHoldThePiecesOfWideSplats) {
  Camera camera;
  camera.position = {16.3, 15.8, 16.1};
  camera.focal_point = {30, 16, 16};
  camera.view_up = {0, 0, 1};
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = 60;
  const ProjectionSettings settings{ScreenView::of(camera, {120, 100}, glm::dvec3(1), 0.3, 0.001)};
  const auto table = ClassificationTable::of(TransferFunction::preset("grey", 0, 1, 1.0), 0, 1);
  const DepthKeys made(settings.view, cache_->manifest().root);
  BrickProjector projector;
  SplatGeometry geometry;
  SplatVariable values;
  uint64_t pieces = 0;
  for (uint32_t id = 0; id < cache_->bricks().size(); ++id) {
    const Brick& brick = cache_->bricks()[id];
    const glm::dvec3 corner = cache_->manifest().root.cellMin(brick.cell);
    cache_->readGeometry(id, geometry);
    cache_->readVariable(id, 0, values);
    projector.project(settings, table, corner, geometry, values);
    pieces += projector.counts().pieces - projector.counts().drawn;
    std::vector<uint32_t> held(projector.depths().size()), free(held.size());
    std::vector<ScreenSplat> splats = projector.splats();
    made.setKeys(splats, projector.depths(), corner, {0, ~uint32_t{0}}, free);
    made.setKeys(projector.mutableSplats(), projector.depths(), corner, made.rangeOf(brick), held);
    for (size_t n = 0; n < held.size(); ++n)
      EXPECT_LE(std::abs(static_cast<double>(held[n]) - free[n]), 64) << id << ' ' << n;
  }
  EXPECT_GT(pieces, 1000u);
}

std::vector<uint32_t> placesOf(std::span<const DepthItem> items) {
  std::vector<uint32_t> places;
  for (const DepthItem& item : items) places.push_back(item.splat);
  return places;
}

TEST(DepthSorter, SortsByKeyAndKeepsTheOrderOfEquals) {
  DepthSorter sorter;
  std::mt19937 random(1);
  for (const size_t count : {0u, 1u, 2u, 100u, 5000u, 20000u, 131072u, 3u})
    for (const uint32_t span : {0u, 1u, 10u, 2047u, 2048u, 1u << 22, ~0u})
      for (const uint32_t least : {0u, 77u, ~0u - span}) {
        std::vector<uint32_t> keys(count);
        for (uint32_t& key : keys)
          key = static_cast<uint32_t>(std::min<uint64_t>(
              uint64_t{least} + (span == ~0u ? random() : random() % (span + 1)), ~uint32_t{0}));
        std::vector<uint32_t> expected(count);
        std::iota(expected.begin(), expected.end(), 0u);
        std::stable_sort(expected.begin(), expected.end(),
                         [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
        const auto sorted = sorter.sort(keys);
        EXPECT_EQ(placesOf(sorted), expected) << count << " keys in " << span;
        EXPECT_TRUE(std::all_of(sorted.begin(), sorted.end(),
                                [&](const DepthItem& item) { return item.key == keys[item.splat]; }));
      }
}

}  // namespace
}  // namespace curvisplat
