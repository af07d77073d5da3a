#include "render/gl/tile_list_shaders.h"

#include <fmt/format.h>

#include "render/project/tile_key.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

constexpr const char* kSums = R"(
shared uint lane_sums[THREADS];

// The sum, or the largest number if that is less: of more entries than can be counted, none is written.
uint sumOf(uint a, uint b) {
  return a + b < a ? 0xffffffffu : a + b;
}

// All threads see after this call what the others have written to shared variables.
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

// Entries lie a chunk of tiles after the other, and in it a tile after the other.
constexpr const char* kPlaces = R"(
layout(std430, binding = 1) PLACES buffer Ends { uint ends[]; };  // [tile of the box] where its entries end, in its chunk
layout(std430, binding = 2) readonly buffer Chunks { uint chunks[]; };  // [chunk] where its entries begin

uvec2 rangeOf(uint tile) {
  uint chunk = chunks[tile / CHUNK];
  return chunk + uvec2(tile % CHUNK == 0u ? 0u : ends[tile - 1u], ends[tile]);
}
)";

// Counts, and writes as well where `writes` says so: one program, since two might round the same ellipse differently, and
// an entry that was not counted would lie in another tile's place. Before it writes, `ends` has where each tile's entries
// begin. Which tiles an ellipse touches: as orderTilesOf() in render/tiles/tile_lists.cpp.
constexpr const char* kList = R"(
layout(std430, binding = 0) readonly buffer Splats { uvec4 splats[]; };  // four a ScreenSplat
layout(std430, binding = 3) readonly buffer Closed { uint closed[]; };   // [tile of the picture] pixels that take no more
layout(std430, binding = 4) writeonly buffer Entries { uvec2 entries[]; };  // the key in the tile, the splat's number
uniform bool writes;
uniform uint splat_count;
uniform uint waiting;      // of them, the first: what they have up to the key `before` was painted
uniform uint before;
uniform uint front;        // up to this key
uniform bool ordered;      // false: one order in all tiles, that of the splats
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

shared int first_rows[THREADS];

struct Listed {
  vec2 at;      // pixels
  vec2 middle;  // the same, from the first pixel's middle
  float lean, span, reach2, tip, reach_y;
};

// The ellipse covers the pixels lean dy +- span sqrt(reach2 - dy dy) at dy, and goes farthest right at dy = tip.
Listed listedOf(uint n) {
  vec4 part0 = uintBitsToFloat(splats[4u * n]);
  float l11 = part0.z, l21 = part0.w, l22 = uintBitsToFloat(splats[4u * n + 1u].x);
  float s11 = l21 * l21 + l22 * l22, reach2 = SUPPORT * SUPPORT * s11;
  return Listed(part0.xy, part0.xy - 0.5, l11 * l21 / s11, l11 * l22 / s11, reach2, SUPPORT * l21, SUPPORT * sqrt(s11));
}

ivec2 rowsOf(Listed splat) {
  return ivec2(firstTile(splat.middle.y - splat.reach_y, box.y, box.w), lastTile(splat.middle.y + splat.reach_y, box.y, box.w) + 1);
}

void listRow(uint n, Listed splat, int row) {
  float top = float(row * side) - splat.middle.y, bottom = top + float(side - 1);
  float right = clamp(splat.tip, top, bottom), left = clamp(-splat.tip, top, bottom);
  float to_x = splat.middle.x + splat.lean * right + splat.span * sqrt(max(splat.reach2 - right * right, 0.0));
  float from_x = splat.middle.x + splat.lean * left - splat.span * sqrt(max(splat.reach2 - left * left, 0.0));
  uvec4 part3 = splats[4u * n + 3u];  // key, first, key_slope0, key_slope1
  vec2 key_slope = uintBitsToFloat(part3.zw);
  int last = lastTile(to_x, box.x, box.z);
  for (int column = firstTile(from_x, box.x, box.z); column <= last; ++column) {
    if (isClosed(ivec2(column, row))) continue;
    uint key = 0u;
    if (ordered) {  // keyAt() in tile_key.h
      vec2 from = vec2(ivec2(column, row) * side) + 0.5 * float(side) - splat.at;
      precise float moved = key_slope.x * from.x + key_slope.y * from.y;
      int held = int(clamp(moved, -MAX_STEPS, MAX_STEPS));
      key = uint(max(int(part3.x) + held, int(part3.y)));
      if (key > front || n < waiting && key <= before) continue;
    }
    uint tile = uint((row - box.y) * (box.z - box.x) + column - box.x);
    uint place = atomicAdd(ends[tile], 1u);
    if (writes) entries[chunks[tile / CHUNK] + place] = uvec2(key, n);
  }
}

// Each thread looks at a splat; then all share the rows of tiles of the group's splats evenly, for one may have hundreds of times
// as many as another.
void main() {
  uint begin = (gl_WorkGroupID.x + gl_WorkGroupID.y * MOST_GROUPS) * THREADS, own = begin + gl_LocalInvocationID.x;
  uint rows = 0u;
  if (own < splat_count && uintBitsToFloat(splats[4u * own].z) >= 0.0) {  // else a record
    ivec2 of_own = rowsOf(listedOf(own));
    rows = uint(max(of_own.y - of_own.x, 0));
    first_rows[gl_LocalInvocationID.x] = of_own.x;
  }
  sumBefore(rows);
  uint all = lane_sums[THREADS - 1u];
  for (uint row = gl_LocalInvocationID.x; row < all; row += THREADS) {
    uint lane = 0u;  // the first whose rows end behind this one
    for (uint step = THREADS / 2u; step > 0u; step /= 2u)
      if (lane_sums[lane + step - 1u] <= row) lane += step;
    uint n = begin + lane;
    uint earlier = lane > 0u ? lane_sums[lane - 1u] : 0u;
    listRow(n, listedOf(n), first_rows[lane] + int(row - earlier));
  }
}
)";

// A group a tile. What lists have come to hold is in no order, but no two entries are the same: sorted, they are the same
// from run to run.
constexpr const char* kSort = R"(
layout(std430, binding = 4) coherent buffer Entries { uvec2 entries[]; };
uniform uint columns;  // of the box
shared uvec2 few[SORTED_AT_ONCE];  // a list, if it is no longer than that
uint begin, count;

uvec2 entryAt(uint n) {
  return count <= SORTED_AT_ONCE ? few[n] : entries[begin + n];
}
void setEntry(uint n, uvec2 entry) {
  if (count <= SORTED_AT_ONCE)
    few[n] = entry;
  else
    entries[begin + n] = entry;
}
void meet() {
  memoryBarrierShared();
  memoryBarrierBuffer();
  barrier();
}

// A bitonic sort in which the smaller of two always goes to the front. So behind the last there may be any number of largest
// ones, which never move.
void sortEntries() {
  uint pairs = 1u << findMSB(count - 1u);
  for (uint span = 2u; span <= 2u * pairs; span *= 2u)
    for (uint reach = span; reach > 1u; reach /= 2u) {
      for (uint n = gl_LocalInvocationID.x; n < pairs; n += THREADS) {
        uint from = n / (reach / 2u) * reach, at = n & (reach / 2u - 1u);
        uint low = from + at, high = reach == span ? from + reach - 1u - at : low + reach / 2u;
        if (high >= count) continue;
        uvec2 first = entryAt(low), second = entryAt(high);
        if (first.x < second.x || first.x == second.x && first.y < second.y) continue;
        setEntry(low, second);
        setEntry(high, first);
      }
      meet();
    }
}

void main() {
  uvec2 range = rangeOf(gl_WorkGroupID.y * columns + gl_WorkGroupID.x);
  begin = range.x;
  count = range.y - range.x;
  if (count < 2u) return;
  if (count <= SORTED_AT_ONCE)
    for (uint n = gl_LocalInvocationID.x; n < count; n += THREADS) few[n] = entries[begin + n];
  meet();
  sortEntries();
  if (count <= SORTED_AT_ONCE)
    for (uint n = gl_LocalInvocationID.x; n < count; n += THREADS) entries[begin + n] = few[n];
}
)";

}  // namespace

std::string tileRanges() {
  return fmt::format("#define CHUNK {}u\n#define PLACES readonly\n{}", kTilesAChunk, kPlaces);
}

std::string tileListShader(TileListStep step) {
  const bool sorts = step == TileListStep::kSort;
  const char* const body = step == TileListStep::kScan ? kScan : sorts ? kSort : kList;
  return fmt::format(
      "#version 430 core\n#define THREADS {0}u\n#define MOST_GROUPS {1}u\n#define SORTED_AT_ONCE "
      "{2}u\n#define CHUNK {3}u\n"
      "#define PLACES {4}\n#define SUPPORT {5:.9g}\n#define MAX_STEPS {6:.1f}\nlayout(local_size_x = {0}) "
      "in;\n{7}{8}{9}",
      sorts ? kSortThreads : kListThreads, kMaxGroups, kSortedAtOnce, kTilesAChunk, sorts ? "readonly" : "",
      static_cast<float>(kKernelSupport), kMaxSteps, step == TileListStep::kScan ? "" : kPlaces,
      sorts ? "" : kSums, body);
}

}  // namespace curvisplat
