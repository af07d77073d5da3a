// A cell that is partly covered by cells of another block, or that reaches into blanked cells: what is left
// of its splat.
//
// The cell is sampled at 64 points. A bit for each says whether another block, or nothing, is there. In
// lattice directions a point is at ±(2m + 1)/32 of the cell from its middle, m = 0..7 once in each octant,
// so that along each axis 16 evenly spaced distances occur: a face of the other block that runs along the
// lattice is found to a sixteenth of a cell. The points stand for equal parts of the cell, and the splat
// gets the moments of those that are left (DESIGN.md, "Overlapping blocks").
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "stream/model/splats.h"

namespace curvisplat {

inline constexpr size_t kCellPoints = 64;
inline constexpr uint64_t kAllCovered = ~uint64_t{0};

inline constexpr size_t kCellOctantCount = 8;

/// The points in octant `octant`, 0 to 7, of the cell; bit `axis` of the number: in its lower half along
/// that axis.
constexpr uint64_t octantPoints(size_t octant) {
  return uint64_t{0xff} << (octant * kCellPoints / kCellOctantCount);
}

/// Bit n of what is covered stands for point n: along i, j and k, in cells from the middle.
const std::array<glm::dvec3, kCellPoints>& cellPoints();

/// A cell that other blocks or blanked cells cover a part of.
struct CoveredCell {
  uint64_t covered;
  glm::dmat3 axes;       // Q's images of the lattice's directions, as node_splats.h has them
  uint32_t border_code;  // of the whole cell; a code of the layer behind a face counts as none
  double next;           // how long the cell behind a border is, in cells that end there: 2 behind half ones
};

/// Cuts the covered part off the splat. Returns the border code of what is left, which ends where the other
/// block begins, and at the whole cell's borders; nullopt if nothing is left. Pure: any thread.
std::optional<uint32_t> keepUncovered(const CoveredCell& cell, Splat& splat, std::span<SplatScalar> values);

}  // namespace curvisplat
