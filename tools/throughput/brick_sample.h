// A part of a frame's bricks, small enough to be measured in seconds and still like the whole: runs of bricks
// that follow one another in drawing order, spread evenly over the frame. Pure.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stream/model/brick.h"

namespace curvisplat {

struct BrickSample {
  std::vector<BrickPart> parts;  // in the frame's order
  uint64_t splats = 0;           // of the parts
};

/// All of `parts` if they have at most `most_splats`; else at most `runs` runs of them with about that many
/// in all, one part at least.
BrickSample sampleOf(std::span<const BrickPart> parts, std::span<const Brick> bricks, uint64_t most_splats,
                     uint32_t runs = 16);

}  // namespace curvisplat
