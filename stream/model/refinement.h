// Refinement, the parts that the cells of the files' grid were cut into before they became splats.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace curvisplat {

/// The parts that each cell of a block is cut into along i, j and k.
using CellCuts = std::array<uint32_t, 3>;

inline constexpr CellCuts kWholeCells{1, 1, 1};

inline std::string textOf(const CellCuts& parts) {
  return fmt::format("{} x {} x {}", parts[0], parts[1], parts[2]);
}

/// The parts of all cells of a grid: the same everywhere, or other ones in each block.
class Refinement {
 public:
  Refinement() = default;
  /// Every cell is cut into parts x parts x parts.
  explicit Refinement(uint32_t parts) : of_all_{parts, parts, parts} {}
  /// [block]
  explicit Refinement(std::vector<CellCuts> of_blocks) {
    const bool same = std::ranges::all_of(of_blocks, [&](const CellCuts& parts) {
      return parts == of_blocks.front() && parts[1] == parts[0] && parts[2] == parts[0];
    });
    if (same)
      of_all_ = of_blocks.empty() ? kWholeCells : of_blocks.front();
    else
      of_blocks_ = std::move(of_blocks);
  }

  bool cutsCells() const { return !isUniform() || of_all_ != kWholeCells; }
  /// Whether all cells are cut into the same number of parts, along all axes.
  bool isUniform() const { return of_blocks_.empty(); }
  /// The number of parts along each axis, if isUniform().
  uint32_t parts() const { return of_all_[0]; }
  /// The parts in each block; empty if isUniform().
  const std::vector<CellCuts>& ofBlocks() const { return of_blocks_; }
  const CellCuts& ofBlock(size_t block) const { return isUniform() ? of_all_ : of_blocks_.at(block); }

  /// The node of the files' grid that is nearest to `node` of the cut one, by its indices along i, j and k.
  std::array<uint64_t, 3> nodeInFiles(size_t block, std::array<uint64_t, 3> node) const {
    const CellCuts& parts = ofBlock(block);
    for (size_t axis = 0; axis < 3; ++axis) node[axis] = (node[axis] + parts[axis] / 2) / parts[axis];
    return node;
  }
  /// The cell of the files' grid that `cell` of the cut one is a part of.
  std::array<uint64_t, 3> cellInFiles(size_t block, std::array<uint64_t, 3> cell) const {
    const CellCuts& parts = ofBlock(block);
    for (size_t axis = 0; axis < 3; ++axis) cell[axis] /= parts[axis];
    return cell;
  }

  bool operator==(const Refinement&) const = default;

 private:
  CellCuts of_all_ = kWholeCells;
  std::vector<CellCuts> of_blocks_;
};

}  // namespace curvisplat
