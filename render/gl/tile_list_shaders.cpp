#include "render/gl/tile_list_shaders.h"

#include <fmt/format.h>

#include "render/project/tile_key.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

// Entries are sorted by keys of 64 bits, the high ones last: the tile's number in the box, and below it, in `key_bits`, the
// splat's key in the tile, from `least_key` on.
constexpr const char* kCommon = R"(
shared uint lane_sums[THREADS];

// The sum, or the largest number if that is less: of more entries than can be counted, none is written.
uint sumOf(uint a, uint b) {
  return a + b < a ? 0xffffffffu : a + b;
}

// What all threads wrote to shared variables is there for all of them.
void meet() {
  memoryBarrierShared();
  barrier();
}

// The sum of the values of the threads before this one; lane_sums[THREADS - 1] is then that of all.
uint sumBefore(uint value) {
  uint thread = gl_LocalInvocationID.x;
  meet();
  lane_sums[thread] = value;
  meet();
  for (uint step = 1u; step < THREADS; step *= 2u) {
    uint added = thread >= step ? lane_sums[thread - step] : 0u;
    meet();
    lane_sums[thread] = sumOf(lane_sums[thread], added);
    meet();
  }
  return lane_sums[thread] - value;
}
)";

constexpr const char* kScan = R"(
layout(std430, binding = 0) buffer Sums { uint sums[]; };  // [row][length]
layout(std430, binding = 1) buffer Totals { uint totals[]; };  // [row]
uniform uint length_of_row;

void main() {
  uint carry = 0u, begin = gl_WorkGroupID.x * length_of_row;
  for (uint from = 0u; from < length_of_row; from += THREADS) {
    uint at = from + gl_LocalInvocationID.x;
    uint value = at < length_of_row ? sums[begin + at] : 0u;
    uint before = sumOf(carry, sumBefore(value));
    if (at < length_of_row) sums[begin + at] = before;
    carry = sumOf(carry, lane_sums[THREADS - 1u]);
  }
  if (gl_LocalInvocationID.x == 0u) totals[gl_WorkGroupID.x] = carry;
}
)";

// Counts, and writes as well where `writes` says so: one program, since two might round the same ellipse differently, and
// an entry that was not counted would lie in another splat's place. Which tiles an ellipse touches: as orderTilesOf() in render/tiles/tile_lists.cpp.
constexpr const char* kList = R"(
layout(std430, binding = 0) readonly buffer Splats { uvec4 splats[]; };  // four a ScreenSplat
layout(std430, binding = 1) buffer Counts { uint counts[]; };            // [splat]
layout(std430, binding = 2) buffer Sums { uint sums[]; };                // [group]
layout(std430, binding = 3) readonly buffer Closed { uint closed[]; };   // [tile of the picture] pixels that take no more
layout(std430, binding = 4) writeonly buffer Keys { uvec2 keys[]; };
layout(std430, binding = 5) writeonly buffer Numbers { uint numbers[]; };
uniform bool writes;
uniform uint first_splat;  // in `splats`
uniform uint splat_count;
uniform uint waiting;      // of them, the first: what they have up to the key `before` was painted
uniform uint before;
uniform uint front;        // up to this key
uniform uint least_key;
uniform uint key_bits;     // 0: one order in all tiles, that of the splats
uniform ivec4 box;         // tiles x0, y0 .. x1 - 1, y1 - 1
uniform int side;          // of a tile, pixels
uniform ivec2 picture;     // pixels
uniform int closed_columns;
uniform int closed_begin;

int firstTile(float from, int least, int most) {
  return int(clamp(ceil((from - float(side - 1) - 0.01) / float(side)), float(least), float(most)));
}
int lastTile(float to, int least, int most) {
  return int(clamp(floor((to + 0.01) / float(side)), float(least) - 1.0, float(most) - 1.0));
}

bool isClosed(ivec2 tile) {
  ivec2 pixels = min(ivec2(side), picture - side * tile);
  return closed[closed_begin + tile.y * closed_columns + tile.x] == uint(pixels.x * pixels.y);
}

// Counts the splat's tiles; the entries that it writes begin at `to`.
uint list(uint n, uint to) {
  uint at = first_splat + n;
  vec4 part0 = uintBitsToFloat(splats[4u * at]);
  if (part0.z < 0.0) return 0u;  // a record
  float l11 = part0.z, l21 = part0.w, l22 = uintBitsToFloat(splats[4u * at + 1u].x);
  uvec4 part3 = splats[4u * at + 3u];  // key, first, key_slope0, key_slope1
  vec2 key_slope = uintBitsToFloat(part3.zw);
  vec2 middle = part0.xy - 0.5;  // from the first pixel's
  float s11 = l21 * l21 + l22 * l22;
  float reach_y = SUPPORT * sqrt(s11);
  // Of pixels at dy the ellipse covers lean dy +- span sqrt(reach2 - dy dy); it goes farthest right at dy = tip.
  float lean = l11 * l21 / s11, span = l11 * l22 / s11, reach2 = SUPPORT * SUPPORT * s11, tip = SUPPORT * l21;
  uint count = 0u;
  int last_row = lastTile(middle.y + reach_y, box.y, box.w);
  for (int row = firstTile(middle.y - reach_y, box.y, box.w); row <= last_row; ++row) {
    float top = float(row * side) - middle.y, bottom = top + float(side - 1);
    float right = clamp(tip, top, bottom), left = clamp(-tip, top, bottom);
    float to_x = middle.x + lean * right + span * sqrt(max(reach2 - right * right, 0.0));
    float from_x = middle.x + lean * left - span * sqrt(max(reach2 - left * left, 0.0));
    int last = lastTile(to_x, box.x, box.z);
    for (int column = firstTile(from_x, box.x, box.z); column <= last; ++column) {
      if (isClosed(ivec2(column, row))) continue;
      uint key = 0u;
      if (key_bits > 0u) {  // keyAt() in tile_key.h
        vec2 from = vec2(ivec2(column, row) * side) + 0.5 * float(side) - part0.xy;
        precise float moved = key_slope.x * from.x + key_slope.y * from.y;
        int held = int(clamp(moved, -MAX_STEPS, MAX_STEPS));
        key = uint(max(int(part3.x) + held, int(part3.y)));
        if (key > front || n < waiting && key <= before) continue;
        key = min(max(key, least_key) - least_key, 0xffffffffu >> (32u - key_bits));
      }
      if (writes) {
        uint tile = uint((row - box.y) * (box.z - box.x) + column - box.x);
        keys[to + count] = key_bits == 0u    ? uvec2(tile, 0u)
                           : key_bits == 32u ? uvec2(key, tile)
                                             : uvec2(key | tile << key_bits, tile >> (32u - key_bits));
        numbers[to + count] = at;
      }
      ++count;
    }
  }
  return count;
}

void main() {
  uint n = gl_GlobalInvocationID.x;
  uint to = writes ? sums[gl_WorkGroupID.x] + sumBefore(n < splat_count ? counts[n] : 0u) : 0u;
  uint count = n < splat_count ? list(n, to) : 0u;
  if (writes) return;
  if (n < splat_count) counts[n] = count;
  sumBefore(count);
  if (gl_LocalInvocationID.x == 0u) sums[gl_WorkGroupID.x] = lane_sums[THREADS - 1u];
}
)";

constexpr const char* kEntries = R"(
layout(std430, binding = 0) readonly buffer Keys { uvec2 keys[]; };
layout(std430, binding = 1) readonly buffer Numbers { uint numbers[]; };
uniform uint entry_count;
uniform uint shift;  // of the digit, or of the tile

uint bitsFrom(uvec2 key) {
  return shift == 0u ? key.x : shift < 32u ? key.x >> shift | key.y << (32u - shift) : key.y >> (shift - 32u);
}
uint digitOf(uint entry) {
  return bitsFrom(keys[entry]) & (DIGITS - 1u);
}
)";

constexpr const char* kHistogram = R"(
layout(std430, binding = 2) buffer Sums { uint sums[]; };  // [digit][group]
shared uint histogram[DIGITS];

void main() {
  uint thread = gl_LocalInvocationID.x;
  histogram[thread] = 0u;
  meet();
  for (uint n = thread; n < SORTED_A_GROUP; n += THREADS) {
    uint entry = gl_WorkGroupID.x * SORTED_A_GROUP + n;
    if (entry < entry_count) atomicAdd(histogram[digitOf(entry)], 1u);
  }
  meet();
  sums[thread * gl_NumWorkGroups.x + gl_WorkGroupID.x] = histogram[thread];
}
)";

// Finds places by sets of bits: which threads have a digit. So an entry's place follows from its number
// alone, and threads write into the sets in any order.
constexpr const char* kScatter = R"(
layout(std430, binding = 2) readonly buffer Sums { uint sums[]; };
layout(std430, binding = 3) readonly buffer Totals { uint totals[]; };  // [digit]
layout(std430, binding = 4) writeonly buffer SortedKeys { uvec2 sorted_keys[]; };
layout(std430, binding = 5) writeonly buffer SortedNumbers { uint sorted_numbers[]; };
const uint kWords = THREADS / 32u;
shared uint offsets[DIGITS];
shared uint having[DIGITS * kWords];

void main() {
  uint thread = gl_LocalInvocationID.x, word = thread / 32u, bit = thread % 32u;
  offsets[thread] = sumBefore(totals[thread]) + sums[thread * gl_NumWorkGroups.x + gl_WorkGroupID.x];
  for (uint n = 0u; n < SORTED_A_GROUP; n += THREADS) {
    for (uint w = 0u; w < kWords; ++w) having[thread * kWords + w] = 0u;
    meet();
    uint entry = gl_WorkGroupID.x * SORTED_A_GROUP + n + thread, digit = 0u;
    bool is_any = entry < entry_count;
    if (is_any) {
      digit = digitOf(entry);
      atomicOr(having[digit * kWords + word], 1u << bit);
    }
    meet();
    if (is_any) {
      uint place = offsets[digit] + uint(bitCount(having[digit * kWords + word] & ((1u << bit) - 1u)));
      for (uint w = 0u; w < word; ++w) place += uint(bitCount(having[digit * kWords + w]));
      sorted_keys[place] = keys[entry];
      sorted_numbers[place] = numbers[entry];
    }
    meet();
    for (uint w = 0u; w < kWords; ++w) offsets[thread] += uint(bitCount(having[thread * kWords + w]));
  }
}
)";

constexpr const char* kRanges = R"(
layout(std430, binding = 2) buffer Ranges { uvec2 ranges[]; };  // [tile of the box]

void main() {
  uint entry = gl_GlobalInvocationID.x;
  if (entry >= entry_count) return;
  uint tile = bitsFrom(keys[entry]);
  if (entry == 0u || bitsFrom(keys[entry - 1u]) != tile) ranges[tile].x = entry;
  if (entry + 1u == entry_count || bitsFrom(keys[entry + 1u]) != tile) ranges[tile].y = entry + 1u;
}
)";

}  // namespace

std::string tileListShader(TileListStep step) {
  const bool sorts =
      step == TileListStep::kHistogram || step == TileListStep::kScatter || step == TileListStep::kRanges;
  const char* const body = step == TileListStep::kScan        ? kScan
                           : step == TileListStep::kHistogram ? kHistogram
                           : step == TileListStep::kScatter   ? kScatter
                           : step == TileListStep::kRanges    ? kRanges
                                                              : kList;
  return fmt::format(
      "#version 430 core\n#define THREADS {}u\n#define DIGITS {}u\n#define SORTED_A_GROUP {}u\n#define "
      "SUPPORT {:.9g}\n#define MAX_STEPS {:.1f}\nlayout(local_size_x = {}) in;\n{}{}{}",
      kListThreads, kDigits, kSortedAGroup, static_cast<float>(kKernelSupport), kMaxSteps, kListThreads,
      kCommon, sorts ? kEntries : "", body);
}

}  // namespace curvisplat
