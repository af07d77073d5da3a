// The octree: its cells, the fixed-point positions that decide which cell a splat is in, and the bricks that
// hold the splats of a cell, as the index of a cache knows them.
//
// The root is a cube. A position in it is three 48-bit integers, so that the cell of a position at any
// level, and its voxel in any dyadic lattice, are shifts: exact, and the same on every machine, thread count
// and memory budget. A coarser position (a brick stores fewer bits) stands for the middle of its interval
// and therefore stays in the same cell and voxel.
//
// Plain data and pure functions: any thread may use them.
#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <functional>

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
  /// The cell that this one is an octant of. The root's parent is the root.
  Cell parent() const { return level == 0 ? *this : Cell{level - 1, {at[0] >> 1, at[1] >> 1, at[2] >> 1}}; }
  /// Bit 0 of an octant is x, bit 1 is y, bit 2 is z.
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

/// The Morton order of the cells of one level, in which x is the least significant. Bricks of a level are in
/// this order.
bool mortonLess(const Cell& a, const Cell& b);

/// The cube of the root, in world units.
struct RootCube {
  glm::dvec3 min{0.0};
  double size = 1.0;

  /// The smallest cube, centred on the box and 1e-9 larger than its longest side, that holds the closed box
  /// [lower, upper]. But along an axis on which the box is no thicker than a voxel of the root's brick, it lies in
  /// the middle of a cell of each level whose cells hold it: coarse levels do not halve it. A box without extent
  /// gives a cube of size 1. Throws Error if a bound is not finite.
  static RootCube around(const glm::dvec3& lower, const glm::dvec3& upper);

  /// The position of a point, rounded down to the lattice. A point outside the cube is moved to its face.
  RootPosition fromWorld(const glm::dvec3& world) const;
  /// The middle of the position's interval.
  glm::dvec3 toWorld(const RootPosition& position) const;

  double cellSize(uint32_t level) const;
  glm::dvec3 cellMin(const Cell& cell) const;
};

inline constexpr uint32_t kNoBrick = 0xffffffff;
inline constexpr uint32_t kMaxBrickSplats = 65536;

/// A piece of a file: where a brick's stream lies. The checksum is XXH3 (64 bit) of the bytes as they are in
/// the file.
struct Extent {
  uint64_t offset = 0;
  uint32_t length = 0;
  uint64_t checksum = 0;
};

/// A brick as the index knows it: everything that choosing, culling, ordering and reading need, without its
/// payload.
struct Brick {
  Cell cell;
  uint32_t splats = 0;  // 1 .. kMaxBrickSplats
  std::array<uint32_t, 8>
      octant_splats{};  // sums to splats. Inner bricks store them by octant, leaves in grid order
  glm::dvec3 lower{0.0}, upper{0.0};  // box of the centres, world units, inside the cell
  float largest_radius = 0;  // world units: no splat's support (kernel.h) reaches further from its centre
  float error = 0;           // world units: 0 for a leaf; the detail an inner brick has merged away
  uint32_t parent = kNoBrick;
  uint32_t first_child =
      kNoBrick;              // children are consecutive, Morton order; a cell that could not be split has
  uint32_t child_count = 0;  // several consecutive bricks
  Extent geometry;

  bool isLeaf() const { return child_count == 0; }
};

inline constexpr uint8_t kAllOctants = 0xff;

/// A brick, or those of its octants that are drawn from it: bit n stands for octant n. Part of an inner
/// brick stands in for children that are not drawn while the others are; a leaf is drawn whole.
struct BrickPart {
  uint32_t brick = 0;
  uint8_t octants = kAllOctants;
  uint16_t merging =
      0;  // how layers of thin cells are merged: its place in the list of the frame, from 1. 0: not
  bool operator==(const BrickPart&) const = default;

  bool whole() const { return octants == kAllOctants; }
};

/// Splats begin .. end - 1 of a brick, in the order in which they are stored.
struct SplatRange {
  uint32_t begin = 0, end = 0;
  bool operator==(const SplatRange&) const = default;

  uint32_t size() const { return end - begin; }
};

/// The ranges in which the splats of a part of a brick lie: octants that follow one another make one range,
/// so that there are at most four.
class SplatRanges {
 public:
  SplatRanges(const Brick& brick, uint8_t octants) {
    if (octants == kAllOctants) {
      add({0, brick.splats});
      return;
    }
    uint32_t begin = 0;
    for (int octant = 0; octant < 8; ++octant) {
      const uint32_t end = begin + brick.octant_splats[octant];
      if (octants >> octant & 1) add({begin, end});
      begin = end;
    }
  }

  const SplatRange* begin() const { return ranges_.data(); }
  const SplatRange* end() const { return ranges_.data() + count_; }
  size_t size() const { return count_; }
  uint32_t splats() const {
    uint32_t sum = 0;
    for (const SplatRange& range : *this) sum += range.size();
    return sum;
  }

 private:
  void add(const SplatRange& range) {
    if (range.size() == 0) return;
    if (count_ > 0 && ranges_[count_ - 1].end == range.begin)
      ranges_[count_ - 1].end = range.end;
    else
      ranges_[count_++] = range;
  }

  std::array<SplatRange, 4> ranges_;
  size_t count_ = 0;
};

/// The record of a brick in a variable's table: where its values are, and bounds of them.
struct BrickVariable {
  Extent values;
  float min = 0, max = 0;       // of the means, the scalar's unit
  float largest_slope = 0;      // of |w|, the scalar's unit: how far a mean reaches over one kernel radius;
                                // at faces to be cut at as it is drawn
  float largest_deviation = 0;  // of √r, the scalar's unit: the largest residual standard deviation
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
