// A brick as the index knows it: everything that choosing, culling, ordering and reading need, without its
// payload.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>

#include "stream/model/octree.h"

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

/// A brick, or those of its octants that are drawn from it: bit n stands for octant n. Part of an inner brick
/// stands in for children that are not drawn while the others are; a leaf is drawn whole.
struct BrickPart {
  uint32_t brick = 0;
  uint8_t octants = kAllOctants;
  bool operator==(const BrickPart&) const = default;

  bool whole() const { return octants == kAllOctants; }
};

/// Splats begin .. end - 1 of a brick, in the order in which they are stored.
struct SplatRange {
  uint32_t begin = 0, end = 0;
  bool operator==(const SplatRange&) const = default;

  uint32_t size() const { return end - begin; }
};

/// Where the splats of a part of a brick lie: octants that follow one another make one range, so that there
/// are at most four.
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

/// What a variable's table says of a brick.
struct BrickVariable {
  Extent values;
  float min = 0, max = 0;       // of the means, the scalar's unit
  float largest_slope = 0;      // of |w|, the scalar's unit: how far a mean reaches over one kernel radius;
                                // at faces to be cut at as it is drawn
  float largest_deviation = 0;  // of √r, the scalar's unit: the largest residual standard deviation
};

}  // namespace curvisplat
