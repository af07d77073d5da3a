// Thin walls of structured grids: where nodes at one position, on the two sides of a wall without thickness, have splats of
// their own (preprocess/seams/wall_search.h). Caches with the feature kThinWalls list their boxes in walls.bin, one record
// after the other, little-endian:
//
//     block u32 | side u32 | first node i, j, k u64 | last node i, j, k u64        56 bytes
//
// Drawing does not need them. Adding scalars does: it has to make the same splats.
#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

namespace curvisplat {

inline constexpr const char* kThinWalls = "thin-walls";  // Manifest::requirements
inline constexpr const char* kThinWallsFileName = "walls.bin";
inline constexpr uint64_t kMaxThinWallsBytes = 64 << 20;

/// A box of nodes of one block that lie on one side of a thin wall. Nodes at one position are merged only if their sides
/// are equal; those in no box have side 0.
struct WallSide {
  uint32_t block = 0, side = 0;
  std::array<uint64_t, 3> first{}, last{};  // i, j, k; the last is included

  bool operator==(const WallSide&) const = default;
};
static_assert(sizeof(WallSide) == 56 && std::is_trivially_copyable_v<WallSide>);

}  // namespace curvisplat
