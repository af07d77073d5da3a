#include "stream/model/octree.h"

#include <algorithm>
#include <cmath>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kPositionEnd = uint64_t{1} << kPositionBits;

}  // namespace

bool mortonLess(const Cell& a, const Cell& b) {
  // The axis whose highest differing bit is highest decides; on a tie z before y before x.
  int deciding = 2;
  uint32_t deciding_difference = a.at[2] ^ b.at[2];
  for (int axis = 1; axis >= 0; --axis) {
    const uint32_t difference = a.at[axis] ^ b.at[axis];
    const bool higher_bit =
        deciding_difference < difference && deciding_difference < (deciding_difference ^ difference);
    if (higher_bit) {
      deciding = axis;
      deciding_difference = difference;
    }
  }
  return a.at[deciding] < b.at[deciding];
}

RootCube RootCube::around(const glm::dvec3& lower, const glm::dvec3& upper) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(lower[axis]) || !std::isfinite(upper[axis]))
      throw Error("the grid's bounds [{}, {}] along {} are not finite", lower[axis], upper[axis],
                  "xyz"[axis]);
  }
  const glm::dvec3 extent = upper - lower;
  double size = std::max({extent.x, extent.y, extent.z}) * (1 + 1e-9);
  if (!(size > 0)) size = 1.0;
  constexpr int kThin = 5;  // the level whose cells are as large as a voxel of the root's brick
  RootCube root{0.5 * (lower + upper) - 0.5 * size, size};
  for (int axis = 0; axis < 3; ++axis) {
    int level = 0;
    while (level < kMaxLevel && (1 + 1e-9) * extent[axis] <= std::ldexp(size, -level - 1)) ++level;
    if (level >= kThin) root.min[axis] -= std::ldexp(size, -level - 1);
  }
  return root;
}

RootPosition RootCube::fromWorld(const glm::dvec3& world) const {
  RootPosition position;
  for (int axis = 0; axis < 3; ++axis) {
    const double scaled = (world[axis] - min[axis]) / size * static_cast<double>(kPositionEnd);
    position.at[axis] = static_cast<uint64_t>(std::clamp(scaled, 0.0, static_cast<double>(kPositionEnd - 1)));
  }
  return position;
}

glm::dvec3 RootCube::toWorld(const RootPosition& position) const {
  glm::dvec3 world;
  for (int axis = 0; axis < 3; ++axis)
    world[axis] = min[axis] +
                  size * ((static_cast<double>(position.at[axis]) + 0.5) / static_cast<double>(kPositionEnd));
  return world;
}

double RootCube::cellSize(uint32_t level) const {
  return std::ldexp(size, -static_cast<int>(level));
}

glm::dvec3 RootCube::cellMin(const Cell& cell) const {
  return min + cellSize(cell.level) * glm::dvec3(cell.at[0], cell.at[1], cell.at[2]);
}

}  // namespace curvisplat
