// Nodes of a block as the splats' code takes them: blocks of nodes from functions, the splats of a whole
// block, a part of a block's nodes as a source reads it, and a window of a part of the rows.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <random>

#include "preprocess/grid/grid_source.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/splats/block_window.h"
#include "preprocess/splats/node_splats.h"
#include "stream/model/corrections.h"

namespace curvisplat {

/// A block with its nodes in memory, at mapping(i, j, k); nothing is blank.
struct MappedBlock {
  GridBlock block;
  NodeArrays nodes;
  uint64_t first_node = 0;

  using Mapping = std::function<glm::dvec3(double i, double j, double k)>;
  MappedBlock(uint64_t ni, uint64_t nj, uint64_t nk, const Mapping& mapping);

  size_t at(uint64_t i, uint64_t j, uint64_t k) const { return (k * block.nj + j) * block.ni + i; }
  /// Adds a scalar that is `f` of the node's position.
  void addScalar(const std::function<double(const glm::dvec3&)>& f);
  void roundToFloat();
  BlockWindow window() const { return {block, first_node, {0, block.nj, 0, block.nk}, &nodes}; }
  NodeSplats splats(const SplatCorrections& corrections = {}, const SplatRules& rules = {}) const;
};

double totalWeight(const NodeSplats& splats);
bool allFinite(const NodeSplats& splats);

glm::dmat3 randomRotation(std::mt19937_64& random);

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
