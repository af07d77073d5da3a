// The brick of a cell of the octree, of the bricks of its children.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "preprocess/convert/build_cell.h"
#include "stream/model/brick_splats.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// The bricks of one octant of a cell; none: it is empty.
struct ChildBricks {
  Cell cell;
  uint64_t bricks = 0;
  double error = 0;                             // the largest of theirs
  std::function<BrickSplats(uint64_t n)> read;  // the n-th, decoded; any thread
};

/// Merges them, in parallel. Throws what reading throws.
BuiltCell buildFromChildren(const RootCube& root, size_t variables, const Cell& cell,
                            const std::array<ChildBricks, 8>& children);

}  // namespace curvisplat
