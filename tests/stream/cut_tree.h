// Random octrees and views for tests of the cut, all from a seed.
#pragma once

#include <algorithm>
#include <glm/glm.hpp>
#include <numeric>
#include <optional>
#include <random>
#include <vector>

#include "stream/paging/cut.h"

namespace curvisplat {

/// A random octree over the cube [-1, 1]³, level by level as in the index.
struct CutTestTree {
  RootCube root{glm::dvec3(-1), 2};
  std::vector<Brick> bricks;
  std::vector<BrickVariable> variables;
  std::vector<ValueBounds> subtrees;

  explicit CutTestTree(uint32_t seed) {
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
    for (size_t id = 1; id < bricks.size(); ++id) {
      const Brick& child = bricks[id];
      bricks[child.parent].octant_splats[child.cell.octantInParent()] = 1 + random() % 12;
    }
    for (Brick& each : bricks) {
      if (!each.isLeaf())
        each.splats = std::accumulate(each.octant_splats.begin(), each.octant_splats.end(), 0u);
      each.geometry.length = 100 + random() % 100;
      each.error = each.isLeaf() ? 0.0f : static_cast<float>(0.05 * root.cellSize(each.cell.level));
      const auto low = static_cast<float>(unit(random));
      variables.push_back({{0, 50, 0}, low, low + 0.1f, 0.01f, 0.01f});
    }
    subtrees = subtreeBounds(bricks, variables);
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

  Cut cut(const CutView& view, const CutOptions& options,
          const TransparentBounds& transparent = opaque) const {
    return chooseCut({root, bricks, variables, subtrees}, view, transparent, options);
  }
  Cut cut(const CutView& view, double lod_pixels, const TransparentBounds& transparent = opaque) const {
    CutOptions options;
    options.lod_pixels = lod_pixels;
    return cut(view, options, transparent);
  }
  static bool opaque(const ValueBounds&) { return false; }
};

inline glm::dvec3 randomDirection(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
}

inline CutView randomView(std::mt19937& random, bool perspective) {
  std::uniform_real_distribution<double> unit(0, 1);
  CutView view;
  view.perspective = perspective;
  view.scale = unit(random) < 0.5 ? glm::dvec3(1) : glm::dvec3(1, 2, 0.5);
  view.eye = 3 * unit(random) * randomDirection(random);  // inside of the data as well
  view.towards_viewer = randomDirection(random);
  view.pixels = 100;
  return view;
}

/// The distance at which a ray enters a stretched cell; none if it misses it.
inline std::optional<double> entry(const CutTestTree& tree, const CutView& view, const Cell& cell,
                                   const glm::dvec3& origin, const glm::dvec3& direction) {
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

}  // namespace curvisplat
