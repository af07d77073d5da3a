// Where splats of unstructured grids end: at the outer faces of the mesh, which only one cell has. DESIGN.md,
// "Unstructured grids".
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

#include "stream/model/splats.h"

namespace curvisplat {

/// A share of an outer face.
struct OuterPlane {
  glm::dvec3 inward{0.0};  // at right angles to the face, as long as the share is large; not 0
  glm::dvec3 point{0.0};   // the face's centre
  bool touches =
      true;  // it is a face of the splat's; else of one beside it, which the splat may reach beyond
};

/// The border code (stream/model/border_code.h) of a splat near these faces, whose order counts in the last bits.
/// `next`: how much longer the splats behind it are, across the face.
uint32_t meshBorderCode(std::span<const OuterPlane> planes, const Splat& splat, double next);

/// Dual cells of outer points are half as thick as those behind them; cells are alike.
inline constexpr double kNextOfPoints = 2, kNextOfCells = 1;

}  // namespace curvisplat
