// Nodes to splats: design section 3. Each node that is there gives one splat, the piece of space around it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/grid_source.h"
#include "stream/splats.h"

namespace curvisplat {

/// A node's splat on its way into the cache.
struct NodeSplat {
  uint64_t node = 0;              // number in the whole grid: block after block, i fastest, then j, k
  Splat splat;                    // position: world units, moved inwards where the node owns a half cell
  bool regular = true;            // weight is a0 a1 a2, and every variable's variance is 0
  bool on_block_face = false;     // may coincide with a node of another face: to be merged by SeamMerger
  glm::dvec3 node_position{0.0};  // where the node itself is
  double spacing = 0;  // the smallest distance > 0 to a neighbour along an axis; the seams' tolerance
};

/// The splats of some rows of one block. Values are [splat * variables + variable].
struct NodeSplats {
  std::vector<NodeSplat> splats;  // in node order
  std::vector<SplatScalar> values;
  uint64_t degenerate = 0;  // splats with a floored axis
  uint64_t inverted = 0;    // det J has the other sign than most of the block's: counted, drawn
};

/// A window of one block: `nodes` holds `window`, which is `box` and a halo of one plane in j and k where the
/// block goes on.
struct BlockWindow {
  GridBlock block;
  uint64_t first_node = 0;  // of the block in the whole grid
  NodeBox window;
  const NodeArrays* nodes = nullptr;  // i fastest; scalars in the order of the cache's variables
};

/// Computes the splats of the nodes of `box` that are not blank. Overwrites `out` and keeps its capacity.
/// Pure: any thread. Throws nothing but bad_alloc.
void computeNodeSplats(const BlockWindow& in, const NodeBox& box, NodeSplats& out);

}  // namespace curvisplat
