// Blocks of nodes from functions, and the splats of a whole block, for tests.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <random>

#include "preprocess/splats/node_splats.h"

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
  NodeSplats splats(const NodeSplatCorrections& corrections = {}) const;
};

double totalWeight(const NodeSplats& splats);
bool allFinite(const NodeSplats& splats);

glm::dmat3 randomRotation(std::mt19937_64& random);

}  // namespace curvisplat
