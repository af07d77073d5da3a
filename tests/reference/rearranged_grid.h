// A block of another grid, told in another way: its axes swapped or mirrored, or cut into abutting blocks.
// What is drawn must not change.
#pragma once

#include <array>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

struct Rearrangement {
  std::array<int, 3> axes{0, 1, 2};       // i, j, k run along these axes of the original
  std::array<bool, 3> mirrored{};         // i, j, k run backwards
  std::array<uint64_t, 3> cuts{1, 1, 1};  // blocks along i, j, k; neighbours share a face of nodes
};

/// The first block of `source`, with all its scalars, held in memory.
class RearrangedGridSource : public GridSource {
 public:
  RearrangedGridSource(const GridSource& source, const Rearrangement& how);

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override;

 private:
  GridDescription description_;
  Rearrangement how_;
  NodeArrays nodes_;
  std::array<uint64_t, 3> size_;                // of the original
  std::vector<std::array<uint64_t, 3>> first_;  // [block] along i, j, k
};

}  // namespace curvisplat
