// Overset grids of a scene: its own block, and boxes in it that overlap it and one another, with the same field.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "preprocess/scenes/scene.h"
#include "tests/reference/function_grid.h"

namespace curvisplat {

/// A box of even nodes, turned about its middle.
struct OversetBox {
  glm::dvec3 middle{0.0}, size{1.0};
  uint64_t nodes = 2;  // along each axis
  double turn = 0;     // about z, then about x
};

/// The scene's block of ni x nj x nk nodes first. One scalar "s0", the scene's.
FunctionGridSource oversetGrid(std::shared_ptr<const Scene> scene, const GridBlock& block,
                               const std::vector<OversetBox>& boxes, Centring centring = Centring::kNode);

/// One to five boxes in the half-annulus: they lie inside it, and from the second on overlap one another.
std::vector<OversetBox> boxesInHalfAnnulus(size_t count, uint64_t nodes);

}  // namespace curvisplat
