// Extents, the boxes of node indices in VTK's structured files, and the resolution of overlaps between them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace curvisplat {

/// Node indices i0 i1 j0 j1 k0 k1, both ends inclusive.
struct VtkExtent {
  std::array<int64_t, 3> lower{}, upper{};

  uint64_t nodesAlong(size_t axis) const { return static_cast<uint64_t>(upper[axis] - lower[axis] + 1); }
  uint64_t nodes() const { return nodesAlong(0) * nodesAlong(1) * nodesAlong(2); }
  /// Number of cells by VTK's rule: a flat extent has one layer of cells.
  uint64_t cells() const;
  bool isFlat() const;
  std::string describe() const;  // "33x33x16"
  bool operator==(const VtkExtent&) const = default;
};

/// Cuts pieces that may overlap (by ghost levels) into parts that cover each cell once: a cell in several
/// pieces belongs to the first of them. Returns [piece] -> its parts, none if other pieces own all its cells.
/// Throws Error if a piece would be cut into unreasonably many parts.
std::vector<std::vector<VtkExtent>> ownedParts(const std::vector<VtkExtent>& pieces);

}  // namespace curvisplat
