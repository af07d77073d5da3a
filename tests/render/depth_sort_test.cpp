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

// Against depths in double precision: no two splats that differ by more than rounding change places, and
// holding keys within their brick's range moves none by more than that.
TEST_F(DepthKeysTest, AreInTheOrderOfTheDepths) {
  std::mt19937 random(3);
  const RootCube& root = cache_->manifest().root;
  for (const glm::dvec3& scale : {glm::dvec3(1), glm::dvec3(1, 2, 0.5)})
    for (const glm::dvec3& position : {glm::dvec3(90, 20, 30), glm::dvec3(-20, 16, 16), glm::dvec3(5, 6, 7)})
      for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
        const ScreenView view = viewFrom(position, projection, scale);
        const DepthKeys nearest_first(view, root, DrawingOrder::kFrontToBack);
        const DepthKeys farthest_first(view, root, DrawingOrder::kBackToFront);
        std::vector<std::pair<double, uint32_t>> keyed;
        for (const Brick& brick : cache_->bricks()) {
          const glm::dvec3 corner = root.cellMin(brick.cell);
          const KeyRange range = nearest_first.rangeOf(brick);
          ASSERT_LE(range.first, range.last);
          std::vector<float> depths;
          std::vector<double> exact;
          for (int n = 0; n < 50; ++n) {
            const glm::dvec3 part(random() / 4294967295.0, random() / 4294967295.0, random() / 4294967295.0);
            const glm::dvec3 at = view.viewFromData(glm::mix(brick.lower, brick.upper, part));
            const bool perspective = projection == Projection::kPerspective;
            exact.push_back(perspective ? glm::length(at) : at.z);
            depths.push_back(
                static_cast<float>(perspective ? glm::length(at) : at.z - view.viewFromData(corner).z));
          }
          std::vector<uint32_t> keys(depths.size()), free(depths.size()), backwards(depths.size());
          nearest_first.keysOf(depths, corner, range, keys);
          nearest_first.keysOf(depths, corner, {0, ~uint32_t{0}}, free);
          farthest_first.keysOf(depths, corner, farthest_first.rangeOf(brick), backwards);
          for (size_t n = 0; n < keys.size(); ++n) {
            EXPECT_GE(keys[n], range.first);
            EXPECT_LE(keys[n], range.last);
            EXPECT_EQ(backwards[n], ~keys[n]);
            EXPECT_LE(std::abs(static_cast<double>(keys[n]) - free[n]), 128);  // 5e-7 of the root
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
    for (const DrawingOrder order : {DrawingOrder::kFrontToBack, DrawingOrder::kBackToFront}) {
      const DepthKeys made(viewFrom({90, 20, 30}, projection, glm::dvec3(1)), root, order);
      const KeyRange range = made.rangeOf(brick);
      made.keysOf(depths, root.cellMin(brick.cell), range, keys);
      for (const uint32_t key : keys) {
        EXPECT_GE(key, range.first);
        EXPECT_LE(key, range.last);
      }
    }
}

// Where splats are cut into pieces, their depths are still their own.
TEST_F(DepthKeysTest, RangesHoldThePiecesOfWideSplats) {
  Camera camera;
  camera.position = {16.3, 15.8, 16.1};
  camera.focal_point = {30, 16, 16};
  camera.view_up = {0, 0, 1};
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = 60;
  const ProjectionSettings settings{ScreenView::of(camera, {120, 100}, glm::dvec3(1), 0.3, 0.001)};
  const auto table = ClassificationTable::of(TransferFunction::preset("grey", 0, 1, 1.0), 0, 1);
  const DepthKeys made(settings.view, cache_->manifest().root, DrawingOrder::kFrontToBack);
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
    made.keysOf(projector.depths(), corner, made.rangeOf(brick), held);
    made.keysOf(projector.depths(), corner, {0, ~uint32_t{0}}, free);
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
        const auto sorted = sorter.sort(keys, DrawingOrder::kFrontToBack);
        EXPECT_EQ(placesOf(sorted), expected) << count << " keys in " << span;
        EXPECT_TRUE(std::all_of(sorted.begin(), sorted.end(),
                                [&](const DepthItem& item) { return item.key == keys[item.splat]; }));
      }
}

TEST(DepthSorter, BackToFrontIsFrontToBackFromItsEnd) {
  DepthSorter sorter;
  std::mt19937 random(2);
  std::vector<uint32_t> keys(3000), complements;
  for (uint32_t& key : keys) key = static_cast<uint32_t>(random() % 100);
  for (const uint32_t key : keys) complements.push_back(~key);
  std::vector<uint32_t> forwards = placesOf(sorter.sort(keys, DrawingOrder::kFrontToBack));
  std::reverse(forwards.begin(), forwards.end());
  EXPECT_EQ(placesOf(sorter.sort(complements, DrawingOrder::kBackToFront)), forwards);
}

}  // namespace
}  // namespace curvisplat
