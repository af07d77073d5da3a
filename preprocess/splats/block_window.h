// The input of the splats of a box of nodes: a window of a block, and its nodes with the neighbours
// that are there along i, j and k. Views of memory that the caller has; any thread may read them.
#pragma once

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/stretch.h"

namespace curvisplat {

/// The nodes that are read around a box of nodes.
inline constexpr Halo kNodeSplatHalo{kStretchReach, kStretchReach};

/// A window of one block: `nodes` holds `window`, which is `box` and its halo (kNodeSplatHalo) inside the
/// block. Where the window has parts of rows, that includes the halo of the nodes i0 to i1.
struct BlockWindow {
  GridBlock block;
  uint64_t first_node = 0;  // of the block in the whole grid
  NodeBox window;
  const NodeArrays* nodes = nullptr;  // i fastest; scalars in the order of the cache's variables
  uint64_t i0 = 0, i1 = UINT64_MAX;   // of each row of the box, splats are made of these nodes only
  const uint64_t* covered = nullptr;  // [sample]: by other blocks (shape/covered_part.h); null: none are

  uint64_t endOfPart(uint64_t count) const { return std::min(i1, count); }
};

/// Scratch memory of computeNodeSplats() (node_splats.h); keeps its capacity.
struct NodeScratch {
  std::array<std::vector<float>, 3> stretch, growth, drift;  // [axis][node of a row's part]
  std::array<std::vector<JointLine>, 3> lines;               // the same, of nodes at faces and one away
  std::vector<uint8_t> has_blank;                            // [row around the box]
  std::vector<uint8_t> near_blank;                           // [node of a row's part]
};

/// The neighbours of a node, counted in elements of NodeArrays. A missing neighbour is the node itself:
/// half the difference of the two is then the Jacobian's column in every case.
struct Neighbours {
  std::array<ptrdiff_t, 3> before{}, after{};  // along i, j, k; <= 0 and >= 0
};

/// The nodes of a window: views of NodeArrays.
struct NodeLattice {
  const double *x = nullptr, *y = nullptr, *z = nullptr;
  const uint8_t* blank = nullptr;

  glm::dvec3 position(ptrdiff_t at) const { return {x[at], y[at], z[at]}; }

  /// The smallest distance > 0 to a neighbour; 0 if there is none.
  double spacing(ptrdiff_t at, const Neighbours& neighbours) const {
    double smallest = std::numeric_limits<double>::infinity();
    for (const auto& offsets : {neighbours.before, neighbours.after}) {
      for (const ptrdiff_t offset : offsets) {
        const double distance = glm::distance(position(at + offset), position(at));
        if (distance > 0) smallest = std::min(smallest, distance);
      }
    }
    return std::isfinite(smallest) ? smallest : 0.0;
  }
};

/// How far a cell's middle lies beside the line through its column, where the grid line bends at the node:
/// the cell's two halves go straight to either neighbour, `before` and `after` away, and weigh as much as
/// they are long.
inline glm::dvec3 asideOf(const glm::dvec3& to_before, const glm::dvec3& to_after, double before,
                          double after) {
  if (!(before + after > 0)) return glm::dvec3(0.0);
  const double share = before / (before + after);
  return 0.25 * (share * to_after - (1 - share) * to_before);
}

}  // namespace curvisplat
