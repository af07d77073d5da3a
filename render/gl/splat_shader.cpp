#include "render/gl/splat_shader.h"

#include <fmt/format.h>

#include "render/gl/tile_list_shaders.h"
#include "render/project/record_tags.h"

namespace curvisplat {
namespace {

constexpr const char* kUniforms = R"(
uniform float support;
uniform bool lit;
uniform float low_pass;           // pixels squared
uniform float deviation;          // of the kernel, in u
uniform samplerBuffer footprint;  // F and the step to the next, over rho squared
uniform float footprint_steps;    // per unit of rho squared
uniform samplerBuffer classes;    // cumulative: colour times extinction, extinction
uniform int cells;
uniform vec2 cells_from_scalar;   // factor, offset
uniform vec4 below;
uniform vec4 above;
uniform float most_extinction;    // of the table
uniform bool log_scale;
uniform float least_logarithmic;
uniform samplerBuffer colours;    // those of the colours' scalar, with extinction 1, and so for the rest
uniform vec2 cells_from_colour;
uniform vec4 colours_below;
uniform vec4 colours_above;
uniform bool colour_log_scale;
uniform sampler2D layers;  // depths of the pixel's layers, nearest first; infinite beyond the last
)";

// The variables that the pixels of a splat share: from the vertices to the fragments, or variables of a
// compute shader.
constexpr const char* kPerSplat = R"(
PER_SPLAT vec2 centre;
PER_SPLAT vec3 u_from_d;  // of L: 1 / l11, -l21 / (l11 l22), 1 / l22
PER_SPLAT float amplitude;
PER_SPLAT vec4 scalar;   // mean, slope0, slope1, half_width
PER_SPLAT vec4 colour;   // the same of the scalar of the colours
PER_SPLAT float colour_correlation;
PER_SPLAT mat3 faces;    // a face a column; of the splats that are cut
PER_SPLAT vec2 cut;      // far_sides, correlation
PER_SPLAT vec3 hiding;   // along, that of the colours' scalar, the cell's depth; paint_visits-inl.h
PER_SPLAT vec2 light;    // diffuse, specular
PER_SPLAT vec4 skew;       // t30, t21, t12, t03: footprint.h
PER_SPLAT vec4 depth_line;  // of the splats that meet layers: the middle, by u, deviations per depth; else no more than 0
)";

// The floats of a ScreenSplat, of its ScreenColour, and of the two records before those.
constexpr const char* kSetUp = R"(
const float kNoFace = 4.0;

vec4 skewOf(int bits) {
  return 0.01 * vec4(ivec4(bits << 24, bits << 16, bits << 8, bits) >> 24);
}

struct Record {
  vec4 part0;  // x, y, l11, l21
  vec4 part1;  // l22, amplitude, mean, slope0
  vec2 part2;  // slope1, half_width
};

struct ColourRecord {
  vec4 part0;  // mean, slope0, minus the correlation and a mark, slope1
  vec2 part1;  // half_width, along
};

// next: its ScreenCut or ScreenDepth, if its amplitude is negative; beyond: the ScreenCut of one with a ScreenDepth
void setUp(Record splat, int packed_skew, float along_ray, ColourRecord of_colours, Record next, Record beyond) {
  faces = mat3(next.part0.xyw, next.part1.xyz, vec3(next.part1.w, next.part2));
  cut.x = floor(-next.part0.z / kFarSidesTag);
  cut.y = -next.part0.z - kFarSidesTag * cut.x - kCutTag;
  depth_line = vec4(0.0);
  if (splat.part1.y < 0.0 && next.part0.z < 2.0 - kDepthTag) {
    depth_line = vec4(next.part0.xyw, next.part1.x);
    bool has_cut = next.part0.z < 2.0 - kDepthOfCutTag;
    faces = has_cut ? mat3(beyond.part0.xyw, beyond.part1.xyz, vec3(beyond.part1.w, beyond.part2)) : mat3(kNoFace, 0.0, 0.0, kNoFace, 0.0, 0.0, kNoFace, 0.0, 0.0);
    cut.x = has_cut ? floor(-beyond.part0.z / kFarSidesTag) : 0.0;
    cut.y = -next.part0.z - (has_cut ? kDepthOfCutTag : kDepthTag);
  }
  centre = splat.part0.xy;
  u_from_d = vec3(1.0 / splat.part0.z, -splat.part0.w / (splat.part0.z * splat.part1.x), 1.0 / splat.part1.x);
  amplitude = splat.part1.y;
  scalar = vec4(splat.part1.zw, splat.part2);
  colour = vec4(of_colours.part0.xyw, of_colours.part1.x);
  colour_correlation = -of_colours.part0.z - kColourTag;
  skew = skewOf(packed_skew);
  light = vec2(1.0, 0.0);
  if (lit) {  // light.h
    uint bits = floatBitsToUint(splat.part2.y);
    scalar.w = uintBitsToFloat(bits & 0xffff0000u);
    light = vec2(float(bits >> 7 & 511u) / 511.0, float(bits & 127u) / 127.0);
  }
  // What the cell has along the ray: the amplitude without the low-pass.
  float passed = splat.part0.z * splat.part1.x, s01 = splat.part0.z * splat.part0.w;
  float determinant = (splat.part0.z * splat.part0.z - low_pass) * (splat.part0.w * splat.part0.w + splat.part1.x * splat.part1.x - low_pass) - s01 * s01;
  float cell_depth = abs(amplitude) * passed / sqrt(max(determinant, 1e-4 * passed * passed));
  float nearer = 1.7320508 * abs(along_ray) * min(1.0, cell_depth * most_extinction / 6.0);
  float cells_a_scalar = abs(cells_from_scalar.x) / (log_scale ? max(abs(scalar.x), 1e-37) : 1.0);
  float of_colour = 1.7320508 * abs(of_colours.part1.y) * min(1.0, cell_depth * most_extinction / 6.0);
  float cells_a_colour = abs(cells_from_colour.x) / (colour_log_scale ? max(abs(colour.x), 1e-37) : 1.0);
  hiding = vec3(nearer * cells_a_scalar > 16.0 ? along_ray : 0.0, of_colour * cells_a_colour > 16.0 ? of_colours.part1.y : 0.0,
                cell_depth);
}
)";

constexpr const char* kVertexShader = R"(
layout(location = 0) in vec4 part0;  // Record
layout(location = 1) in vec4 part1;
layout(location = 2) in vec2 part2;
layout(location = 3) in vec4 next0;
layout(location = 4) in vec4 next1;
layout(location = 5) in vec2 next2;
layout(location = 6) in vec4 beyond0;
layout(location = 7) in vec4 beyond1;
layout(location = 8) in vec2 beyond2;
layout(location = 9) in int packed_skew;
layout(location = 10) in ivec2 clip;    // the pixels that it is drawn in: x and y of the first, 16 bits each; the side
layout(location = 11) in float along_ray;
layout(location = 12) in vec4 colour0;  // its ScreenColour, which then lies between it and those
layout(location = 13) in vec2 colour1;
uniform vec2 clip_from_pixel;

void main() {
  if (part0.z < 0.0) {  // a record, of which nothing is drawn
    gl_Position = vec4(2.0, 2.0, 0.0, 1.0);
    return;
  }
  setUp(Record(part0, part1, part2), packed_skew, along_ray, ColourRecord(colour0, colour1),
        Record(next0, next1, next2), Record(beyond0, beyond1, beyond2));
  // The ellipse's own rectangle, within the pixels that it is clipped to.
  vec2 reach = support * vec2(part0.z, length(vec2(part0.w, part1.x)));
  vec2 first = vec2(clip.x & 0xffff, clip.x >> 16 & 0xffff);
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  vec2 pixel = clamp(centre + reach * (2.0 * corner - 1.0), first, first + float(clip.y));
  gl_Position = vec4(pixel * clip_from_pixel - 1.0, 0.0, 1.0);
}
)";

// Look-ups interpolate by hand: filtering in hardware has 8 bits of fraction.
constexpr const char* kSeen = R"(
float cellsOf(float value, bool log_scale, vec2 cells_from) {
  float v = log_scale ? log(max(value, least_logarithmic)) : value;
  return v * cells_from.x + cells_from.y;
}

vec4 integral(samplerBuffer table, float x, vec4 below_all, vec4 above_all) {
  float inside = clamp(x, 0.0, float(cells));
  int cell = min(int(inside), cells - 1);
  vec4 from = texelFetch(table, cell);
  return from + (texelFetch(table, cell + 1) - from) * (inside - float(cell)) + below_all * min(x, 0.0) +
         above_all * max(x - float(cells), 0.0);
}

// The bounds of mean +- width in a table, in cells. Limited to a cell beyond its ends, where nothing changes any more.
vec2 interval(float mean, float width, bool log_scale, vec2 cells_from) {
  float from = min(cellsOf(mean - width, log_scale, cells_from), float(cells) + 1.0);
  float to = max(cellsOf(mean + width, log_scale, cells_from), -1.0);
  float widen = max(0.0, 0.5 * (1.0 - (to - from)));
  return vec2(from - widen, to + widen);
}

// 1 - exp(-x) without cancellation
float absorbed(float x) {
  float series = x * (1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0)))));
  return x < 0.25 ? series : 1.0 - exp(-x);
}

const float kReach = 2.6457513;  // of the biweight's distribution of depths, in deviations

// The distribution's integrals over [0, x kReach]: of 1, of -32/5 x, and of x squared.
vec3 integralsTo(float x) {
  float x2 = x * x, rest = 1.0 - x2;
  return vec3(x * (0.9375 + x2 * (-0.625 + 0.1875 * x2)), rest * rest * rest,
              x * x2 * (0.3125 + x2 * (-0.375 + 0.13392857 * x2)));
}

// The remainder between two depths that the faces leave: the share, the mean and the variance of the depths,
// those over kReach deviations.
vec3 remainder(vec2 u, float lo, float hi) {
  vec3 a = vec3(1.0, u) * faces / kReach;
  int far_sides = int(cut.x);
  for (int n = 0; n < 3; ++n) {
    if ((far_sides >> n & 1) != 0)
      lo = max(lo, -a[n]);
    else
      hi = min(hi, a[n]);
  }
  lo = min(lo, 1.0);
  hi = max(hi, lo);
  vec3 left = integralsTo(hi) - integralsTo(lo);
  float share = max(left.x, 0.0);
  float mean = clamp(-5.0 / 32.0 * left.y / max(share, 1e-6), lo, hi);
  return vec3(share, mean, left.z / max(share, 1e-6) - mean * mean);
}

// How much nearer than its middle a splat of this optical depth is seen, in half widths of its depths; and which part of
// their variance is not seen. As nearSide() and lostByHiding() in paint_blocks-inl.h.
vec2 nearSide(float tau) {
  if (tau < 0.02) return vec2(tau / 6.0, 0.0);
  float part = absorbed(tau) / tau;
  float side = (2.0 - absorbed(tau) - 2.0 * part) / absorbed(tau);
  return vec2(side, 1.0 - clamp(3.0 * (1.0 - side * side - 4.0 * side / tau), 0.0, 1.0));
}

// A scalar (mean, slopes, half_width), with the mean and the width of what is seen of it, where `side` is nearSide() and
// `along` the scalar's change with the depth.
vec4 seenOf(vec4 of, float along, vec2 side) {
  return vec4(of.x - 1.7320508 * along * side.x, of.yz, sqrt(max(0.0, of.w * of.w - 3.0 * along * along * side.y)));
}

// The interval of a scalar (mean, slopes, half_width) at u. By its correlation with the depth, what is left
// of the depths moves the mean and narrows the width: `left` has their mean, and the part of their variance
// that is lost.
vec2 intervalOf(vec4 of, float correlation, vec2 u, vec2 left, bool log_scale, vec2 cells_from) {
  float mean = PER_PIXEL ? of.x + dot(of.yz, u) : of.x;
  float width = PER_PIXEL ? of.w : 0.0;
  float deviation = correlation * width * 0.57735027;
  mean += deviation * kReach * left.x;
  width = left.y > 0.0 ? sqrt(max(0.0, width * width - 3.0 * deviation * deviation * left.y)) : width;
  return interval(mean, width, log_scale, cells_from);
}

// The colour that is seen of a splat with this optical depth per extinction, between two depths.
vec4 seenBetween(vec2 u, float depth, float lo, float hi) {
  vec3 left = vec3(1.0, 0.0, 0.0);
  if (amplitude < 0.0) left = remainder(u, lo, hi);
  float lost = amplitude < 0.0 ? 1.0 - clamp(7.0 * left.z, 0.0, 1.0) : 0.0;
  depth *= left.x;
  // Splats that meet layers hide of themselves what is left in each window: a part of their optical depth, and of their depths.
  vec2 hides = depth_line.w > 0.0 ? vec2(left.x, sqrt(1.0 - lost)) : vec2(1.0);
  vec2 ends = intervalOf(scalar, cut.y, u, vec2(left.y, lost), LOG_SCALE, cells_from_scalar);
  vec4 seen = max((integral(classes, ends.y, below, above) - integral(classes, ends.x, below, above)) / (ends.y - ends.x), 0.0);
#if COLOURED
  vec2 middle = interval(scalar.x, PER_PIXEL ? scalar.w : 0.0, LOG_SCALE, cells_from_scalar);
  float of_middle = max((integral(classes, middle.y, below, above) - integral(classes, middle.x, below, above)).w / (middle.y - middle.x), 0.0);
  vec4 near_colour = PER_PIXEL ? seenOf(colour, hides.y * hiding.y, nearSide(hides.x * hiding.z * of_middle)) : colour;
  ends = intervalOf(near_colour, colour_correlation, u, vec2(left.y, lost), COLOUR_LOG_SCALE, cells_from_colour);
  seen.rgb = max((integral(colours, ends.y, colours_below, colours_above) -
                  integral(colours, ends.x, colours_below, colours_above)).rgb / (ends.y - ends.x), 0.0) * seen.w;
#else
  if (PER_PIXEL && hiding.x != 0.0) {
    vec4 near_scalar = seenOf(scalar, hides.y * hiding.x, nearSide(hides.x * hiding.z * seen.w));
    ends = intervalOf(near_scalar, cut.y, u, vec2(left.y, lost), LOG_SCALE, cells_from_scalar);
    vec4 near = max((integral(classes, ends.y, below, above) - integral(classes, ends.x, below, above)) / (ends.y - ends.x), 0.0);
    if (seen.w > 0.0) seen.rgb = (near.rgb + seen.rgb / 64.0) * (seen.w / (near.w + seen.w / 64.0));
  }
#endif

  float alpha = absorbed(seen.w * depth);
  vec3 lit = seen.rgb * light.x + seen.w * light.y;
  return vec4(seen.w > 0.0 ? lit * (alpha / seen.w) : vec3(0.0), alpha);
}

#if WINDOWS > 1 || LAYERED
// The colour that is seen in the window between layers n - 1 and n.
vec4 seenIn(int n, vec2 u, float depth, vec4 ends) {
  float lo = n > 0 ? clamp(ends[max(n - 1, 0)], -1.0, 1.0) : -1.0, hi = n < 4 ? clamp(ends[min(n, 3)], -1.0, 1.0) : 1.0;
  if (lo >= hi) return vec4(0.0);
  return seenBetween(u, depth, lo, hi);
}
#endif


// The splat's optical depth per extinction.
float depthAt(vec2 u, float rho2) {
  float at = rho2 * footprint_steps;
  vec2 texel = texelFetch(footprint, int(at)).xy;
  float depth = abs(amplitude) * (texel.x + texel.y * fract(at));
  if (skew != vec4(0.0)) {
    vec2 v = u / deviation;
    float cubic = skew.x * v.x * v.x * v.x + 3.0 * v.x * v.y * (skew.y * v.x + skew.z * v.y) + skew.w * v.y * v.y * v.y;
    depth *= max(0.0, 1.0 + (cubic - 3.0 * ((skew.x + skew.z) * v.x + (skew.y + skew.w) * v.y)) / 6.0);
  }
  return depth;
}
)";

constexpr const char* kFragmentShader = R"(
layout(location = 0) out vec4 blended0;
#if WINDOWS > 1
layout(location = 1) out vec4 blended1;
#endif
#if WINDOWS > 2
layout(location = 2) out vec4 blended2;
#endif
#if WINDOWS > 3
layout(location = 3) out vec4 blended3;
#endif
#if WINDOWS > 4
layout(location = 4) out vec4 blended4;
#endif

void main() {
  vec2 d = gl_FragCoord.xy - centre;
  vec2 u = vec2(u_from_d.x * d.x, u_from_d.y * d.x + u_from_d.z * d.y);
  float rho2 = dot(u, u);
  if (rho2 >= support * support) discard;

  float depth = depthAt(u, rho2);
#if WINDOWS > 1 || LAYERED
  vec4 ends = vec4(1.0);
  if (depth_line.w > 0.0) {
    float middle = depth_line.x + dot(depth_line.yz, u);
    ends = (texelFetch(layers, ivec2(gl_FragCoord.xy), 0) - middle) * (depth_line.w / kReach);
  }
  blended0 = seenIn(0, u, depth, ends);
#else
  blended0 = seenBetween(u, depth, -1.0, 1.0);
#endif
#if WINDOWS > 1
  blended1 = seenIn(1, u, depth, ends);
#endif
#if WINDOWS > 2
  blended2 = seenIn(2, u, depth, ends);
#endif
#if WINDOWS > 3
  blended3 = seenIn(3, u, depth, ends);
#endif
#if WINDOWS > 4
  blended4 = seenIn(4, u, depth, ends);
#endif
}
)";

// A pixel a thread, 8x8 pixels a work group; each goes through the list of its own tile. `kSaturated` as on the processor,
// where blocks of 4x4 pixels end together: less than 1/4096 is left out.
constexpr const char* kTileShader = R"(
layout(local_size_x = 8, local_size_y = 8) in;
layout(std430, binding = 0) readonly buffer Splats { uvec4 splats[]; };  // four a ScreenSplat
layout(std430, binding = 4) readonly buffer Entries { uvec2 entries[]; };  // their numbers last, tile after tile
layout(std430, binding = 3) buffer Closed { uint closed[]; };  // [tile of the picture] its pixels that take no more
layout(rgba32f, binding = 0) uniform image2DArray windows;     // [window of depth]: colour and transmittance
uniform ivec4 clip;    // pixels that may be drawn
uniform ivec2 origin;  // of the box, in pixels
uniform int side;      // of the tiles
uniform int columns;   // of the box
uniform ivec3 closed_places;  // columns of the picture's small tiles, and of its large ones; where those begin
const float kSaturated = 1.0 / 4096.0;
#if COUNTS
layout(std430, binding = COUNTS_BINDING) buffer Counts { uvec2 counts[]; };  // [large tile]: splats looked at, splats blended
uniform bool counts_alone;
uvec2 counted = uvec2(0);
#endif

Record recordOf(int n) {
  return Record(uintBitsToFloat(splats[4 * n]), uintBitsToFloat(splats[4 * n + 1]), uintBitsToFloat(splats[4 * n + 2].xy));
}

void main() {
  ivec2 place = ivec2(gl_GlobalInvocationID.xy), pixel = origin + place, tile = place / side;
  if (any(lessThan(pixel, clip.xy)) || any(greaterThanEqual(pixel, clip.zw))) return;
  uvec2 range = rangeOf(uint(tile.y * columns + tile.x));
  if (range.x == range.y) return;
  vec4 seen[WINDOWS];  // transmittances last
  for (int n = 0; n < WINDOWS; ++n) seen[n] = imageLoad(windows, ivec3(pixel, n));
  if (seen[0].w < kSaturated) return;
#if LAYERED
  vec4 depths = texelFetch(layers, pixel, 0);
#endif
  for (uint at = range.x; at < range.y && seen[0].w >= kSaturated; ++at) {
    int n = int(entries[at].y);
#if COUNTS
    ++counted.x;
#endif
    Record splat = recordOf(n);
    vec2 d = vec2(pixel) + 0.5 - splat.part0.xy;
    vec2 u = vec2(d.x / splat.part0.z, (d.y - splat.part0.w * (d.x / splat.part0.z)) / splat.part1.x);
    float rho2 = dot(u, u);
    if (rho2 >= support * support) continue;
#if COUNTS
    ++counted.y;
    if (counts_alone) continue;
#endif
    uvec2 tail = splats[4 * n + 2].zw;  // skew, along
    // Zeros where it has none: what the driver leaves in them is computed with, if only times 0.
    Record next = Record(vec4(0.0), vec4(0.0), vec2(0.0)), beyond = next;
    if (splat.part1.y < 0.0) {
      next = recordOf(n - 1 - COLOURED);
      beyond = recordOf(max(n - 2 - COLOURED, 0));  // of the first splat's last record: not used
    }
    ColourRecord of_colours = ColourRecord(vec4(0.0), vec2(0.0));
#if COLOURED
    of_colours = ColourRecord(uintBitsToFloat(splats[4 * n - 4]), uintBitsToFloat(splats[4 * n - 3].xy));
#endif
    setUp(splat, int(tail.x), uintBitsToFloat(tail.y), of_colours, next, beyond);
    float depth = depthAt(u, rho2);
#if LAYERED
    vec4 ends = vec4(1.0);
    if (depth_line.w > 0.0) ends = (depths - (depth_line.x + dot(depth_line.yz, u))) * (depth_line.w / kReach);
    for (int window = 0; window < WINDOWS; ++window) {
      vec4 adds = seenIn(window, u, depth, ends);
      seen[window] = vec4(seen[window].rgb + seen[window].w * adds.rgb, seen[window].w * (1.0 - adds.w));
    }
#else
    vec4 adds = seenBetween(u, depth, -1.0, 1.0);
    seen[0] = vec4(seen[0].rgb + seen[0].w * adds.rgb, seen[0].w * (1.0 - adds.w));
#endif
  }
#if COUNTS
  int counts_at = pixel.y / LARGE_TILE * closed_places.y + pixel.x / LARGE_TILE;
  atomicAdd(counts[counts_at].x, counted.x);
  atomicAdd(counts[counts_at].y, counted.y);
#endif
  for (int n = 0; n < WINDOWS; ++n) imageStore(windows, ivec3(pixel, n), seen[n]);
  if (seen[0].w >= kSaturated) return;
  atomicAdd(closed[pixel.y / SMALL_TILE * closed_places.x + pixel.x / SMALL_TILE], 1u);
  atomicAdd(closed[closed_places.z + pixel.y / LARGE_TILE * closed_places.y + pixel.x / LARGE_TILE], 1u);
}
)";

std::string kindOf(const SplatShaderKind& kind) {
  return fmt::format(
      "#define PER_PIXEL {}\n#define LOG_SCALE {}\n#define LAYERED {:d}\n#define WINDOWS {}\n#define "
      "COLOURED "
      "{:d}\n#define COLOUR_LOG_SCALE {}\n#define COUNTS {:d}\n#define COUNTS_BINDING {}\n",
      kind.per_pixel, kind.log_scale, kind.layered, kind.windows, kind.coloured, kind.colour_log_scale,
      kind.counts, kPixelCountsBinding);
}

std::string recordTags() {
  return fmt::format(
      "const float kCutTag = {:.1f}, kFarSidesTag = {:.1f}, kDepthTag = {:.1f}, kDepthOfCutTag = {:.1f}, "
      "kColourTag = {:.1f};\n",
      kCutTag, kFarSidesTag, kDepthTag, kDepthOfCutTag, kColourTag);
}

}  // namespace

std::string splatUniforms() {
  return kUniforms;
}

std::string splatVertexShader() {
  return fmt::format("#version 330 core\n#define PER_SPLAT flat out\n{}{}{}{}{}", kUniforms, kPerSplat,
                     recordTags(), kSetUp, kVertexShader);
}

std::string splatFragmentShader(SplatShaderKind kind) {
  return fmt::format("#version 330 core\n#define PER_SPLAT flat in\n{}{}{}{}{}", kindOf(kind), kUniforms,
                     kPerSplat, kSeen, kFragmentShader);
}

std::string splatTileShader(SplatShaderKind kind) {
  return fmt::format(
      "#version 430 core\n#define PER_SPLAT\n#define SMALL_TILE {}\n#define LARGE_TILE {}\n{}{}{}{}{}{}{}{}",
      kSmallTile, kLargeTile, kindOf(kind), kUniforms, kPerSplat, recordTags(), kSetUp, kSeen, tileRanges(),
      kTileShader);
}

}  // namespace curvisplat
