#include "stream/cut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/glm.hpp>
#include <random>
#include <set>

namespace curvisplat {
namespace {

/// A random octree over the cube [-1, 1]³, level by level as in the index.
struct Tree {
  RootCube root{glm::dvec3(-1), 2};
  std::vector<Brick> bricks;
  std::vector<BrickVariable> variables;

  explicit Tree(uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    bricks.push_back(brick({}));
    for (size_t id = 0; id < bricks.size(); ++id) {
      const Cell cell = bricks[id].cell;
      const bool same_cell_again = id > 0 && bricks[id - 1].cell == cell;
      if (same_cell_again || cell.level == 5 || (cell.level > 1 && unit(random) < 0.4)) continue;
      const auto first = static_cast<uint32_t>(bricks.size());
      for (int octant = 0; octant < 8; ++octant) {
        if (unit(random) < 0.25) continue;
        // A cell that could not be split: three bricks, all of them leaves.
        const int parts = cell.level == 4 && octant == 5 ? 3 : 1;
        for (int part = 0; part < parts; ++part) {
          bricks.push_back(brick(cell.child(octant)));
          bricks.back().parent = static_cast<uint32_t>(id);
        }
      }
      bricks[id].first_child = first;
      bricks[id].child_count = static_cast<uint32_t>(bricks.size()) - first;
    }
    for (Brick& each : bricks) {
      each.error = each.isLeaf() ? 0.0f : static_cast<float>(0.05 * root.cellSize(each.cell.level));
      const auto low = static_cast<float>(unit(random));
      variables.push_back({{}, low, low + 0.1f, 0.01f, 0.01f});
    }
  }

  Brick brick(const Cell& cell) const {
    Brick made;
    made.cell = cell;
    made.splats = 10;
    made.lower = root.cellMin(cell) + 0.1 * root.cellSize(cell.level);
    made.upper = root.cellMin(cell) + 0.9 * root.cellSize(cell.level);
    made.largest_radius = static_cast<float>(0.02 * root.cellSize(cell.level));
    return made;
  }

  Cut cut(
      const CutView& view, double lod_pixels,
      const TransparentBounds& transparent = [](const ValueBounds&) { return false; }) const {
    return chooseCut(root, bricks, variables, subtreeBounds(bricks, variables), view, transparent,
                     lod_pixels);
  }
};

glm::dvec3 randomDirection(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
}

CutView randomView(std::mt19937& random, bool perspective) {
  std::uniform_real_distribution<double> unit(0, 1);
  CutView view;
  view.perspective = perspective;
  view.scale = unit(random) < 0.5 ? glm::dvec3(1) : glm::dvec3(1, 2, 0.5);
  view.eye = 3 * unit(random) * randomDirection(random);  // inside of the data as well
  view.towards_viewer = randomDirection(random);
  view.pixels = 100;
  return view;
}

/// Where a ray enters a stretched cell; none if it misses it.
std::optional<double> entry(const Tree& tree, const CutView& view, const Cell& cell, const glm::dvec3& origin,
                            const glm::dvec3& direction) {
  const glm::dvec3 lower = view.scale * tree.root.cellMin(cell);
  const glm::dvec3 upper = view.scale * (tree.root.cellMin(cell) + tree.root.cellSize(cell.level));
  double from = -1e9, to = 1e9;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (lower[axis] - origin[axis]) / direction[axis],
                 b = (upper[axis] - origin[axis]) / direction[axis];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  if (view.perspective) from = std::max(from, 0.0);
  if (!(to > from + 1e-9)) return {};
  return from;
}

TEST(Cut, NeverDrawsAFartherBrickAfterANearerOneOnAnyRay) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> around(-1, 1);
  const Tree tree(5);
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
      for (const uint32_t id : cut.bricks) {
        const Cell& cell = tree.bricks[id].cell;
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
  const Tree tree(6);
  for (int n = 0; n < 20; ++n) {
    const CutView view = randomView(random, n % 2 == 0);
    for (const double lod_pixels : {0.0, 0.5, 3.0, 1e9}) {
      const Cut cut = tree.cut(view, lod_pixels);
      const std::set<uint32_t> taken(cut.bricks.begin(), cut.bricks.end());
      ASSERT_EQ(taken.size(), cut.bricks.size());
      for (uint32_t id = 0; id < tree.bricks.size(); ++id) {
        if (!tree.bricks[id].isLeaf()) continue;
        int covers = 0;
        for (uint32_t up = id; up != kNoBrick; up = tree.bricks[up].parent) covers += taken.count(up);
        ASSERT_EQ(covers, 1) << "leaf " << id << " at " << lod_pixels;
      }
      if (lod_pixels == 0) {
        for (const uint32_t id : cut.bricks) EXPECT_TRUE(tree.bricks[id].isLeaf());
      }
      if (lod_pixels == 1e9 && !view.perspective) {
        EXPECT_EQ(cut.bricks, std::vector<uint32_t>{0});
      }
      EXPECT_EQ(cut.splats, 10 * cut.bricks.size());
    }
  }
}

TEST(Cut, TakesTheCoarsestBrickWhoseErrorIsAllowed) {
  const Tree tree(7);
  CutView view;
  view.pixels = 100;  // errors on the screen: 0.05 x 100 x the cell
  for (const double lod_pixels : {0.7, 1.3, 2.6, 5.1}) {
    for (const uint32_t id : tree.cut(view, lod_pixels).bricks) {
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
  for (const uint32_t id : cut.bricks) {
    if (tree.bricks[id].isLeaf()) continue;
    const glm::dvec3 at = glm::clamp(view.eye, tree.bricks[id].lower, tree.bricks[id].upper);
    EXPECT_LE(tree.bricks[id].error * view.pixels / glm::length(view.eye - at), 0.6);
  }
}

/// By the corners of the box of centres, one after the other.
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

TEST(Cut, LeavesOutWhatIsOutOfTheImageAndNothingElse) {
  std::mt19937 random(3);
  const Tree tree(8);
  for (int n = 0; n < 30; ++n) {
    CutView view = randomView(random, false);
    view.planes = {{randomDirection(random), 0.3}, {randomDirection(random), 0.2}};
    const Cut cut = tree.cut(view, 0);
    const std::set<uint32_t> taken(cut.bricks.begin(), cut.bricks.end());
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
  const Tree tree(9);
  const CutView view = randomView(random, false);
  // Leaves above 0.6 can be seen; inner bricks' own means say nothing of them.
  const TransparentBounds transparent = [](const ValueBounds& values) { return values.max < 0.6f; };
  const Cut cut = tree.cut(view, 0, transparent);
  const std::set<uint32_t> taken(cut.bricks.begin(), cut.bricks.end());
  for (uint32_t id = 0; id < tree.bricks.size(); ++id) {
    if (!tree.bricks[id].isLeaf()) continue;
    EXPECT_EQ(taken.count(id) == 1, tree.variables[id].max >= 0.6f) << id;
  }
  EXPECT_GT(cut.transparent, 0u);
}

}  // namespace
}  // namespace curvisplat
