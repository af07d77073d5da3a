// The GLSL that lists the splats of tiles and sorts the lists (gl_tile_lists.h). OpenGL 4.3, without what not every
// card has: no subgroups, no order of atomic operations that would show in a result.
#pragma once

#include <cstdint>
#include <string>

namespace curvisplat {

/// The steps, each a program; work groups of kListThreads threads.
enum class TileListStep {
  kList,  // a splat a thread: how many tiles it is listed in, and the sum of each group; or its entries, each a key and
  // a number
  kScan,       // a row of sums a group: each becomes the sum of those before it
  kHistogram,  // kSortedAGroup entries a group: how many have each digit
  kScatter,    // the same: moves each entry to its place by the digit, those with equal digits in their order
  kRanges      // an entry a thread: where the list of each tile begins and ends
};

inline constexpr uint32_t kListThreads = 256;
inline constexpr uint32_t kDigitBits = 8;
inline constexpr uint32_t kDigits = 1u << kDigitBits;
inline constexpr uint32_t kSortedAGroup = 8 * kListThreads;
static_assert(kDigits == kListThreads);  // a thread for each digit

std::string tileListShader(TileListStep step);

}  // namespace curvisplat
