// A part of a block's nodes, as a source reads it.
#pragma once

#include <algorithm>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/block_window.h"

namespace curvisplat {

/// The nodes of `box`; `all` has those of the whole block.
inline NodeArrays partOf(const NodeArrays& all, const GridBlock& block, const NodeBox& box) {
  NodeArrays part;
  part.scalars.resize(all.scalars.size());
  const WindowStrides strides({0, block.nj, 0, block.nk}, block.ni);
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j)
      for (uint64_t i = box.i0; i < box.endOfRow(block.ni); ++i) {
        const size_t at = strides.at(i, j, k);
        part.x.push_back(all.x[at]);
        part.y.push_back(all.y[at]);
        part.z.push_back(all.z[at]);
        part.blank.push_back(all.blank[at]);
        for (size_t s = 0; s < all.scalars.size(); ++s) part.scalars[s].push_back(all.scalars[s][at]);
      }
  return part;
}

/// A window for the nodes from `i0` to `i1` alone, whose arrays, `nodes`, have no more than these and their halo. `whole` has
/// whole rows.
inline BlockWindow cutWindow(BlockWindow whole, uint64_t i0, uint64_t i1, const Halo& halo,
                             NodeArrays& nodes) {
  const NodeArrays& all = *whole.nodes;
  whole.i0 = i0;
  whole.i1 = i1;
  whole.window.i0 = i0 - std::min(i0, halo.before);
  whole.window.i1 = std::min(whole.block.ni, i1 + halo.after);
  nodes = partOf(all, whole.block, whole.window);
  whole.nodes = &nodes;
  return whole;
}

}  // namespace curvisplat
