// Sizes of cells, coarse enough that cells of the same size compare equal whatever their rounding.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>

#include "preprocess/grid/hexahedron.h"

namespace curvisplat {

/// Quarters of a power of two of the volume.
using CellSize = int16_t;
inline constexpr CellSize kNoCell = std::numeric_limits<CellSize>::max();

/// A cell without volume is the smallest; one that is not finite, or kNoCell, is none. The limits between sizes are
/// off the volumes that grids of round numbers have.
inline CellSize cellSize(const std::array<glm::dvec3, 8>& corners) {
  constexpr double kOffset = 0.137;
  const double volume = std::abs(Hexahedron(corners).volume());
  if (!std::isfinite(volume)) return kNoCell;
  if (volume == 0) return std::numeric_limits<CellSize>::min();
  return static_cast<CellSize>(std::clamp(std::floor(4 * std::log2(volume) + kOffset), -32000.0, 32000.0));
}

}  // namespace curvisplat
