// Chooses a representative part of a frame's bricks that is small enough to measure in seconds: runs of
// bricks that are consecutive in drawing order, spread evenly over the frame. Pure.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stream/model/brick.h"

namespace curvisplat {

struct BrickSample {
  std::vector<BrickPart> parts;  // in drawing order
  uint64_t splats = 0;           // sum over the parts
};

/// All of `parts` if they hold at most `max_splats` splats; otherwise at most `runs` runs of parts that
/// together hold about `max_splats`, at least one part.
BrickSample sampleOf(std::span<const BrickPart> parts, std::span<const Brick> bricks, uint64_t max_splats,
                     uint32_t runs = 16);

}  // namespace curvisplat
