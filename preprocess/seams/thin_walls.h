// The sides of thin walls that nodes lie on, as a list of boxes, which caches keep (stream/model/thin_walls.h), and for
// merging. Pure but for their memory: any thread may call const functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/model/thin_walls.h"

namespace curvisplat {

/// Finds the side of a node by its number in the whole grid. Takes 24 bytes for each row of a box.
class ThinWalls {
 public:
  ThinWalls() = default;
  /// Boxes that are not in the grid are cut to it.
  ThinWalls(std::span<const WallSide> boxes, std::span<const GridBlock> blocks);
  /// Reads the bytes of a cache's list. Throws Error, with `name`, if they are no boxes, or more than a list of this grid has.
  static ThinWalls read(std::span<const std::byte> bytes, std::span<const GridBlock> blocks,
                        const std::string& name);

  uint32_t sideOf(uint64_t node) const;

 private:
  struct Run {
    uint64_t begin, end;
    uint32_t side;
  };
  std::vector<Run> runs_;  // rising
};

/// A node and its side, which is not 0.
struct WallNode {
  uint64_t node = 0;
  uint32_t side = 0;
};

/// The boxes of `nodes`, which rise. If these are more than `most`, neighbours in their order become one: a node that
/// gets a side so has a splat of its own as well, with its own values.
std::vector<WallSide> wallSidesOf(std::span<const WallNode> nodes, std::span<const GridBlock> blocks,
                                  size_t most = 32768);

}  // namespace curvisplat
