// Boxes of node indices, as VTK's structured files give them, and what of overlapping ones each piece keeps.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace curvisplat {

/// Node indices, both ends included: i0 i1 j0 j1 k0 k1. Cells lie between them.
struct VtkExtent {
  std::array<int64_t, 3> lower{}, upper{};

  uint64_t nodesAlong(size_t axis) const { return static_cast<uint64_t>(upper[axis] - lower[axis] + 1); }
  uint64_t nodes() const { return nodesAlong(0) * nodesAlong(1) * nodesAlong(2); }
  /// As VTK counts them: a flat extent has a layer of cells.
  uint64_t cells() const;
  bool isFlat() const;
  std::string describe() const;  // "33x33x16"
  bool operator==(const VtkExtent&) const = default;
};

/// Of pieces that may overlap (by ghost levels), the parts that cover each cell once: a cell in several
/// pieces goes to the first of them. [piece] -> its parts; none if others have it all. Throws Error if the
/// pieces are so entangled that parts would be many times more than pieces.
std::vector<std::vector<VtkExtent>> ownedParts(const std::vector<VtkExtent>& pieces);

}  // namespace curvisplat
