// One in so many of a grid's positions, taken while the grid is read for another reason: enough to plan buckets by, so
// that the coordinates need not be read once more for counting them.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/grid/slabs.h"

namespace curvisplat {

class PositionSample {
 public:
  /// Of a grid of `nodes` nodes, `most` of them at the most.
  PositionSample(uint64_t nodes, uint64_t most);

  /// How many nodes each of the positions stands for.
  uint32_t nodesEach() const { return nodes_each_; }
  /// Adds those of a slab's box that are there. Which ones they are does not depend on how the grid is cut into slabs.
  void add(const LoadedSlab& loaded, const GridBlock& block);
  std::span<const glm::dvec3> positions() const { return positions_; }

  /// Bytes of memory a position takes.
  static constexpr uint64_t kBytesEach = sizeof(glm::dvec3);

 private:
  uint32_t nodes_each_;
  std::vector<glm::dvec3> positions_;
};

}  // namespace curvisplat
