// The cells of the octree and the fixed-point positions that decide membership.
//
// The root is a cube. A position in it is three 48-bit integers, so that the cell of a position at any level,
// and its voxel in any dyadic lattice, are shifts: exact, and the same on every machine, thread count and
// memory budget. A coarser position (a brick stores fewer bits) stands for the middle of its interval and
// therefore stays in the same cell and voxel.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>

namespace curvisplat {

inline constexpr int kMaxLevel = 24;
inline constexpr int kPositionBits = 48;

/// A position in the root cube; each coordinate in [0, 2^48).
struct RootPosition {
  std::array<uint64_t, 3> at{};
  bool operator==(const RootPosition&) const = default;
};

/// A cell of the octree: level 0 is the root, level n has 2^n cells an axis.
struct Cell {
  uint32_t level = 0;
  std::array<uint32_t, 3> at{};

  bool operator==(const Cell&) const = default;

  /// The cell of `level` that holds `position`.
  static Cell of(const RootPosition& position, uint32_t level) {
    Cell cell{level, {}};
    for (int axis = 0; axis < 3; ++axis)
      cell.at[axis] = static_cast<uint32_t>(position.at[axis] >> (kPositionBits - level));
    return cell;
  }
  bool contains(const RootPosition& position) const {
    const int shift = kPositionBits - static_cast<int>(level);
    return (position.at[0] >> shift == at[0]) & (position.at[1] >> shift == at[1]) &
           (position.at[2] >> shift == at[2]);
  }
  /// Of the root: the root.
  Cell parent() const { return level == 0 ? *this : Cell{level - 1, {at[0] >> 1, at[1] >> 1, at[2] >> 1}}; }
  /// Octant: bit 0 is x, bit 1 is y, bit 2 is z.
  Cell child(int octant) const {
    return {level + 1,
            {at[0] * 2 + (octant & 1), at[1] * 2 + (octant >> 1 & 1), at[2] * 2 + (octant >> 2 & 1)}};
  }
  /// The octant of this cell in its parent.
  int octantInParent() const { return (at[0] & 1) | (at[1] & 1) << 1 | (at[2] & 1) << 2; }
};

/// The octant of `position` in `cell`, which holds it.
inline int octantOf(const RootPosition& position, const Cell& cell) {
  const int shift = kPositionBits - 1 - static_cast<int>(cell.level);
  return static_cast<int>((position.at[0] >> shift & 1) | (position.at[1] >> shift & 1) << 1 |
                          (position.at[2] >> shift & 1) << 2);
}

/// Morton order of the cells of one level: x is the least significant. The order of bricks in a level.
bool mortonLess(const Cell& a, const Cell& b);

/// The cube of the root, in world units.
struct RootCube {
  glm::dvec3 min{0.0};
  double size = 1.0;

  /// The smallest cube, centred on the box and 1e-9 larger than its longest side, that holds the closed box
  /// [lower, upper]. A box without extent gives a cube of size 1. Throws Error if a bound is not finite.
  static RootCube around(const glm::dvec3& lower, const glm::dvec3& upper);

  /// Rounded down to the lattice; a point outside the cube goes to its face.
  RootPosition fromWorld(const glm::dvec3& world) const;
  /// The middle of the position's interval.
  glm::dvec3 toWorld(const RootPosition& position) const;

  double cellSize(uint32_t level) const;
  glm::dvec3 cellMin(const Cell& cell) const;
};

}  // namespace curvisplat

template <>
struct std::hash<curvisplat::Cell> {
  size_t operator()(const curvisplat::Cell& cell) const noexcept {
    uint64_t h = cell.level;
    for (uint32_t v : cell.at) h = (h ^ v) * 0x9e3779b97f4a7c15u, h ^= h >> 29;
    return h;
  }
};
