#include "stream/paging/cut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <random>
#include <set>

#include "tests/stream/cut_tree.h"

namespace curvisplat {
namespace {

/// The bricks of a cut without limits, which are drawn whole and once.
std::set<uint32_t> wholeBricks(const Cut& cut) {
  std::set<uint32_t> bricks;
  for (const BrickPart& part : cut.parts) {
    EXPECT_TRUE(part.whole());
    EXPECT_TRUE(bricks.insert(part.brick).second) << part.brick;
  }
  return bricks;
}

TEST(Cut, NeverDrawsAFartherBrickAfterANearerOneOnAnyRay) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> around(-1, 1);
  const CutTestTree tree(5);
  ASSERT_GT(tree.bricks.size(), 500u);
  int hits = 0;
  for (int n = 0; n < 40; ++n) {
    const CutView view = randomView(random, n % 2 == 0);
    const Cut cut = tree.cut(view, n % 4 < 2 ? 0 : 4);
    for (int ray = 0; ray < 50; ++ray) {
      const glm::dvec3 through = view.scale * glm::dvec3(around(random), around(random), around(random));
      const glm::dvec3 origin = view.perspective ? view.eye : through;
      const glm::dvec3 direction = view.perspective ? through - view.eye : -view.towards_viewer;
      double last = 1e9;
      const Cell* last_cell = nullptr;
      for (const BrickPart& part : cut.parts) {
        const Cell& cell = tree.bricks[part.brick].cell;
        const auto at = entry(tree, view, cell, origin, direction);
        if (!at) continue;
        ++hits;
        if (!last_cell || !(*last_cell == cell)) {
          EXPECT_LT(*at, last + 1e-9);
        }
        last = *at;
        last_cell = &cell;
      }
    }
  }
  EXPECT_GT(hits, 5000);
}

TEST(Cut, CoversEveryLeafOnce) {
  std::mt19937 random(2);
  const CutTestTree tree(6);
  for (int n = 0; n < 20; ++n) {
    const CutView view = randomView(random, n % 2 == 0);
    for (const double lod_pixels : {0.0, 0.5, 3.0, 1e9}) {
      const Cut cut = tree.cut(view, lod_pixels);
      const std::set<uint32_t> taken = wholeBricks(cut);
      for (uint32_t id = 0; id < tree.bricks.size(); ++id) {
        if (!tree.bricks[id].isLeaf()) continue;
        int covers = 0;
        for (uint32_t up = id; up != kNoBrick; up = tree.bricks[up].parent) covers += taken.count(up);
        ASSERT_EQ(covers, 1) << "leaf " << id << " at " << lod_pixels;
      }
      if (lod_pixels == 0) {
        for (const uint32_t id : taken) EXPECT_TRUE(tree.bricks[id].isLeaf());
      }
      if (lod_pixels == 1e9 && !view.perspective) {
        EXPECT_EQ(taken, std::set<uint32_t>{0});
      }
      uint64_t splats = 0, bytes = 0;
      for (const uint32_t id : taken) {
        splats += tree.bricks[id].splats;
        bytes += tree.bricks[id].geometry.length + 50;
      }
      EXPECT_EQ(cut.splats, splats);
      EXPECT_EQ(cut.bytes, bytes);
    }
  }
}

TEST(Cut, TakesTheCoarsestBrickWhoseErrorIsAllowed) {
  const CutTestTree tree(7);
  CutView view;
  view.pixels = 100;  // errors on the screen: 0.05 x 100 x the cell
  for (const double lod_pixels : {0.7, 1.3, 2.6, 5.1}) {
    for (const uint32_t id : wholeBricks(tree.cut(view, lod_pixels))) {
      const Brick& brick = tree.bricks[id];
      EXPECT_LE(brick.error * view.pixels, lod_pixels);
      if (brick.parent != kNoBrick) {
        EXPECT_GT(tree.bricks[brick.parent].error * view.pixels, lod_pixels);
      }
    }
  }
  // In perspective what is far is coarse.
  view.perspective = true;
  view.eye = {0, 0, 4};
  const Cut cut = tree.cut(view, 0.6);
  for (const uint32_t id : wholeBricks(cut)) {
    if (tree.bricks[id].isLeaf()) continue;
    const glm::dvec3 at = glm::clamp(view.eye, tree.bricks[id].lower, tree.bricks[id].upper);
    EXPECT_LE(tree.bricks[id].error * view.pixels / glm::length(view.eye - at), 0.6);
  }
}

/// Whether a brick is out of the image, by the corners of the box of centres, one after the other.
bool outOfImage(const Brick& brick, const CutView& view) {
  const double radius = brick.largest_radius * std::max({view.scale.x, view.scale.y, view.scale.z});
  return std::any_of(view.planes.begin(), view.planes.end(), [&](const CutView::Plane& plane) {
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 at(corner & 1 ? brick.upper.x : brick.lower.x,
                          corner & 2 ? brick.upper.y : brick.lower.y,
                          corner & 4 ? brick.upper.z : brick.lower.z);
      if (glm::dot(plane.normal, view.scale * at) + plane.offset >= -radius) return false;
    }
    return true;
  });
}

TEST(Cut, WeightsDecideWhatIsFineEnough) {
  std::mt19937 random(14);
  const CutTestTree tree(27);
  // Powers of two: errors in single precision take them exactly.
  CutTestTree lighter = tree;
  std::vector<double> weights;
  for (Brick& brick : lighter.bricks) {
    weights.push_back(std::ldexp(1.0, -static_cast<int>(random() % 3)));
    brick.error *= static_cast<float>(weights.back());
  }
  bool differs = false;
  for (int n = 0; n < 20; ++n) {
    const CutView view = randomView(random, n % 2 == 0);
    for (const double lod_pixels : {0.0, 0.5, 1.0, 4.0}) {
      CutOptions options;
      options.lod_pixels = lod_pixels;
      options.error_weight = [&](uint32_t brick) { return weights[brick]; };
      const Cut cut = tree.cut(view, options), expected = lighter.cut(view, lod_pixels);
      EXPECT_EQ(cut.parts, expected.parts);
      EXPECT_EQ(cut.splats, expected.splats);
      EXPECT_LE(cut.largest_error_px, lod_pixels);
      EXPECT_LE(cut.splats, tree.cut(view, lod_pixels).splats);
      differs |= cut.parts != tree.cut(view, lod_pixels).parts;
      // Under limits the same cut comes nearer, and is reached.
      const std::set<uint32_t> whole = wholeBricks(cut);
      for (uint64_t limit = tree.bricks[0].splats; limit <= cut.splats; limit += 997) {
        options.max_splats = limit;
        for (const BrickPart& part : tree.cut(view, options).parts)
          for (uint32_t up = tree.bricks[part.brick].parent; up != kNoBrick; up = tree.bricks[up].parent)
            EXPECT_EQ(whole.count(up), 0u) << "brick " << part.brick << " refines one of the whole cut";
      }
      options.max_splats = std::max<uint64_t>(cut.splats, tree.bricks[0].splats) + 100'000;
      const Cut limited = tree.cut(view, options);
      EXPECT_TRUE(limited.complete);
      EXPECT_EQ(limited.parts, cut.parts);
      EXPECT_EQ(limited.largest_error_px, cut.largest_error_px);
    }
  }
  EXPECT_TRUE(differs);
}

TEST(Cut, LeavesOutWhatIsOutOfTheImageAndNothingElse) {
  std::mt19937 random(3);
  const CutTestTree tree(8);
  for (int n = 0; n < 30; ++n) {
    CutView view = randomView(random, false);
    view.planes = {{randomDirection(random), 0.3}, {randomDirection(random), 0.2}};
    const Cut cut = tree.cut(view, 0);
    const std::set<uint32_t> taken = wholeBricks(cut);
    EXPECT_GT(cut.out_of_image, 0u);
    for (uint32_t id = 0; id < tree.bricks.size(); ++id) {
      if (!tree.bricks[id].isLeaf()) continue;
      bool out = false;
      for (uint32_t up = id; up != kNoBrick; up = tree.bricks[up].parent)
        out |= outOfImage(tree.bricks[up], view);
      EXPECT_EQ(taken.count(id) == 1, !out) << id;
    }
  }
}

TEST(Cut, LeavesOutTransparentSubtreesAndNothingElse) {
  std::mt19937 random(4);
  const CutTestTree tree(9);
  const CutView view = randomView(random, false);
  // Leaves above 0.6 can be seen; inner bricks' own means say nothing of them.
  const TransparentBounds transparent = [](const ValueBounds& values) { return values.max < 0.6f; };
  const Cut cut = tree.cut(view, 0, transparent);
  const std::set<uint32_t> taken = wholeBricks(cut);
  for (uint32_t id = 0; id < tree.bricks.size(); ++id) {
    if (!tree.bricks[id].isLeaf()) continue;
    EXPECT_EQ(taken.count(id) == 1, tree.variables[id].max >= 0.6f) << id;
  }
  EXPECT_GT(cut.transparent, 0u);
}

}  // namespace
}  // namespace curvisplat
