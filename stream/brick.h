// A brick as the index knows it: everything that choosing, culling, ordering and reading need, without its
// payload.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>

#include "stream/octree.h"

namespace curvisplat {

inline constexpr uint32_t kNoBrick = 0xffffffff;
inline constexpr uint32_t kMaxBrickSplats = 65536;

/// A piece of a file: where a brick's stream lies. The checksum is XXH3 (64 bit) of the bytes as they are in
/// the file.
struct Extent {
  uint64_t offset = 0;
  uint32_t length = 0;
  uint64_t checksum = 0;
};

struct Brick {
  Cell cell;
  uint32_t splats = 0;  // 1 .. kMaxBrickSplats
  std::array<uint32_t, 8>
      octant_splats{};  // sums to splats. Inner bricks store them by octant, leaves in grid order
  glm::dvec3 lower{0.0}, upper{0.0};  // box of the centres, world units, inside the cell
  float largest_radius =
      0;            // world units: no splat's support (kernel radius 1.5562) reaches further from its centre
  float error = 0;  // world units: 0 for a leaf; the detail an inner brick has merged away
  uint32_t parent = kNoBrick;
  uint32_t first_child =
      kNoBrick;              // children are consecutive, Morton order; a cell that could not be split has
  uint32_t child_count = 0;  // several consecutive bricks
  Extent geometry;

  bool isLeaf() const { return child_count == 0; }
};

/// What a variable's table says of a brick.
struct BrickVariable {
  Extent values;
  float min = 0, max = 0;       // of the means, the scalar's unit
  float largest_slope = 0;      // of |w|, the scalar's unit: how far a mean reaches over one kernel radius
  float largest_deviation = 0;  // of √r, the scalar's unit: the largest residual standard deviation
};

}  // namespace curvisplat
