#include "preprocess/survey/position_sample.h"

#include <algorithm>

namespace curvisplat {
namespace {

/// 0 .. count - 1, evenly spread, from the number of a row's first node: rows that lie side by side begin apart.
uint64_t phaseOf(uint64_t node, uint64_t count) {
  uint64_t bits = node * 0x9e3779b97f4a7c15;
  bits = (bits ^ bits >> 32) * 0xd6e8feb86659fd93;
  return (bits ^ bits >> 32) % count;
}

}  // namespace

PositionSample::PositionSample(uint64_t nodes, uint64_t most)
    // A row begins anywhere, so there may be one more of each; a little room is for that.
    : nodes_each_(static_cast<uint32_t>(nodes / (most - most / 16) + 1)) {
  positions_.reserve(std::min(nodes / nodes_each_ + nodes / nodes_each_ / 16 + 64, most));
}

void PositionSample::add(const LoadedSlab& loaded, const GridBlock& block) {
  const auto& [slab, nodes, ignored] = loaded;
  const WindowStrides strides(slab.window, block.ni);
  for (uint64_t k = slab.box.k0; k < slab.box.k1; ++k)
    for (uint64_t j = slab.box.j0; j < slab.box.j1; ++j) {
      const uint64_t phase = phaseOf(slab.first_node + (k * block.nj + j) * block.ni, nodes_each_);
      // The first i >= i0 with i % nodes_each_ == phase.
      uint64_t i = slab.box.i0 + (phase + nodes_each_ - slab.box.i0 % nodes_each_) % nodes_each_;
      for (; i < slab.box.endOfRow(block.ni); i += nodes_each_)
        if (const size_t at = strides.at(i, j, k); !nodes.blank[at])
          positions_.emplace_back(nodes.x[at], nodes.y[at], nodes.z[at]);
    }
}

}  // namespace curvisplat
