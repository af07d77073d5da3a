// The GLSL that lists the splats of tiles and sorts the lists (gl_tile_lists.h). OpenGL 4.3, without what not every
// card has: no subgroups. The order of atomic operations does not show in a result.
#pragma once

#include <cstdint>
#include <string>

namespace curvisplat {

/// The steps, each a program.
enum class TileListStep {
  kList,  // kListThreads splats a group, of as many threads: counts their entries in tiles, or writes them
  kScan,  // a row of sums a group, of kListThreads threads: each becomes the sum of those before it
  kSort   // a tile a group, of kSortThreads threads: its entries, by key and number
};

inline constexpr uint32_t kListThreads = 256, kSortThreads = 128;
inline constexpr uint32_t kMaxGroups = 32768;  // along x; every OpenGL has 65535
/// Tiles whose entries are added up by one group.
inline constexpr uint32_t kTilesAChunk = 8 * kListThreads;
/// Entries that are sorted in shared memory; more in the card's, which takes longer.
inline constexpr uint32_t kSortedAtOnce = 1024;

std::string tileListShader(TileListStep step);
/// Declares `uvec2 rangeOf(uint tile)` for other shaders: where a tile's entries begin and end, by the buffers 1 and 2.
std::string tileRanges();

}  // namespace curvisplat
