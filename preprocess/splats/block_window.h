// What the splats of a box of nodes are made from.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/joint_line.h"
#include "preprocess/splats/stretch.h"

namespace curvisplat {

/// What is read around the nodes of a box.
inline constexpr Halo kNodeSplatHalo{kStretchReach, kStretchReach};

/// A window of one block: `nodes` holds `window`, which is `box` and its halo (kNodeSplatHalo) inside the block. Where
/// the window has parts of rows, that includes the halo of the nodes i0 to i1.
struct BlockWindow {
  GridBlock block;
  uint64_t first_node = 0;  // of the block in the whole grid
  NodeBox window;
  const NodeArrays* nodes = nullptr;  // i fastest; scalars in the order of the cache's variables
  uint64_t i0 = 0, i1 = UINT64_MAX;   // of each row of the box, splats are made of these nodes only
  const uint64_t* covered = nullptr;  // [sample]: by other blocks (covered_part.h); null: nothing is

  uint64_t endOfPart(uint64_t count) const { return std::min(i1, count); }
};

/// What computeNodeSplats() (node_splats.h) needs for a while; keeps its capacity.
struct NodeScratch {
  std::array<std::vector<float>, 3> stretch, growth, drift;  // [axis][node of a row's part]
  std::array<std::vector<JointLine>, 3> lines;               // the same, of nodes at faces and one away
  std::vector<uint8_t> has_blank;                            // [row around the box]
  std::vector<uint8_t> near_blank;                           // [node of a row's part]
};

}  // namespace curvisplat
