#include "render/gl/project_shader.h"

#include <fmt/format.h>

#include "render/gl/project_pieces.h"
#include "render/gl/splat_shader.h"
#include "render/project/screen_splat.h"
#include "render/project/tile_key.h"
#include "stream/model/border_code.h"
#include "stream/model/growth_code.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

constexpr const char* kInputs = R"(
layout(local_size_x = THREADS) in;
layout(std430, binding = 0) writeonly buffer Splats { uvec4 splats[]; };  // four a ScreenSplat
layout(std430, binding = 1) readonly buffer Geometry { uint words[]; };
layout(std430, binding = 6) readonly buffer Values { uint values[]; };
layout(std430, binding = 2) readonly buffer Parts { uvec4 parts[]; };    // PART_VECTORS a ShaderPart; then clip planes
layout(std430, binding = 3) readonly buffer Groups { uvec4 groups[]; };  // ShaderGroup
layout(std430, binding = 4) buffer Fates { uint fates[]; };              // off screen, transparent, drawn, in pieces, clipped, hidden
layout(std430, binding = 5) readonly buffer Frames { float frames[]; };  // growthFrames()
layout(std430, binding = 7) readonly buffer Shading { float shading[]; };  // GradientOpacity, ShadowGrid
uniform uint steepness_points;  // of GradientOpacity: magnitude and factor each; 0: none
uniform ivec3 lattice_nodes;    // of ShadowGrid, behind those; 0: none
uniform vec4 nodes_per_unit;
uniform uint group_count;
uniform uint groups_of_splats;  // the others are of splats in pieces
uniform uint first_group;
uniform float reach;  // of SplatChooser
uniform bool per_pixel;
uniform float largest_scalar;
uniform vec2 picture;     // pixels
uniform vec2 middle;
uniform vec4 right;       // a row each of the map from the data: to pixels, or in perspective to the axes of the view
uniform vec4 down;
uniform vec4 forward;     // to depth
uniform float focal;      // pixels
uniform float volume;
uniform float low_pass_px2;
uniform float slope_low_pass_px2;
uniform vec4 light;       // ambient, diffuse, specular, LocalLight's g0 squared
uniform bool light_at_viewer;
uniform vec4 light_towards;
uniform vec4 viewer;      // orthographic: the direction towards it
uniform vec4 scale;
uniform float key_steps;
uniform float key_steps_a_pixel;
shared uint group_fates[FATES];
)";

constexpr const char* kProjectBody = R"(
// Under these rows of a linear map, as ellipseOf() in footprint.h.
struct Ellipse {
  float l11, l21, l22, amplitude, slope0, slope1, half_width, along;
};

Ellipse ellipseOf(vec3 b0, vec3 b1, vec3 w, float variance, float weight) {
  float s00 = dot(b0, b0), s01 = dot(b0, b1), s11 = dot(b1, b1);
  vec3 n = cross(b0, b1);
  float nn = dot(n, n);
  float determinant = nn + low_pass_px2 * (s00 + s11 + low_pass_px2);
  float slope_determinant = nn + slope_low_pass_px2 * (s00 + s11 + slope_low_pass_px2);
  Ellipse e;
  e.l11 = sqrt(s00 + low_pass_px2);
  e.l21 = s01 / e.l11;
  float root = sqrt(determinant);
  e.l22 = root / e.l11;
  e.amplitude = weight / root;
  vec3 m = cross(n, w);
  float h0 = dot(b0, w), h1 = dot(b1, w);
  float g0 = (dot(b1, m) + slope_low_pass_px2 * h0) / slope_determinant;
  float g1 = (slope_low_pass_px2 * h1 - dot(b0, m)) / slope_determinant;
  e.slope0 = e.l11 * g0 + e.l21 * g1;
  e.slope1 = e.l22 * g1;
  float wn = dot(w, n);
  float along2 = nn > 1e-8 * s00 * s11 ? wn * wn / nn : 0.0;
  float unseen = dot(w, w) - (h0 * g0 + h1 * g1);
  e.half_width = sqrt(3.0 * (KERNEL_VARIANCE * max(unseen, along2) + variance));
  e.along = (wn < 0.0 ? -KERNEL_SIGMA : KERNEL_SIGMA) * sqrt(along2);
  return e;
}

// The slope of the plane that a thin splat lies in; as PlaneBlock::fill().
vec2 planeOf(vec3 b0, vec3 b1, vec3 q) {
  float xx = dot(b0, b0), yy = dot(b1, b1), xy = dot(b0, b1), xz = dot(b0, q), yz = dot(b1, q), zz = dot(q, q);
  float epsilon = 1e-6 * (xx + yy) + 1e-20;
  vec3 n = cross(b0, b1), m = cross(n, q);
  float inverse = 1.0 / (dot(n, n) + epsilon * (xx + yy + epsilon));
  vec2 slope = inverse * vec2(dot(b1, m) + epsilon * xz, epsilon * yz - dot(b0, m));
  float explained = slope.x * slope.x * xx + 2.0 * slope.x * slope.y * xy + slope.y * slope.y * yy;
  float rest = zz - 2.0 * (slope.x * xz + slope.y * yz) + explained;
  float steep = length(slope);
  bool leans = explained > 2.0 * rest && steep < 1e30;
  return leans ? min(1.0, STEEPEST / steep) * slope : vec2(0.0);
}

// This is skewOfAxis(), for an axis that is `along` on the screen.
vec4 skewOfAxis(vec2 along, float growth, Ellipse e) {
  float p0 = along.x / e.l11, p1 = (along.y - e.l21 * p0) / e.l22;
  return SKEW_OF_GROWTH * growth * vec4(p0 * p0 * p0, p0 * p0 * p1, p0 * p1 * p1, p1 * p1 * p1);
}

uint packSkew(vec4 t) {
  ivec4 steps = ivec4(roundEven(clamp(t * 100.0, -127.0, 127.0)));
  return uint(steps.x & 255) | uint(steps.y & 255) << 8 | uint(steps.z & 255) << 16 | uint(steps.w & 255) << 24;
}

// This is GrowthBlock::skewOf(); `a0` to `a2` are A's columns on the screen.
uint skewOf(uint code, vec2 a0, vec2 a1, vec2 a2, Ellipse e) {
  if (code == 0u) return 0u;
  vec4 t = vec4(0.0);
  uint frame = (code >> FRAME_SHIFT & FRAME_MASK) * 9u;
  for (uint a = 0u; a < 3u; ++a) {
    float growth = GROWTH_STEP * float(int(code << (32u - GROWTH_BITS * (a + 1u))) >> (32 - int(GROWTH_BITS)));
    if (growth == 0.0) continue;
    uint at = frame + 3u * a;
    t += skewOfAxis(frames[at] * a0 + frames[at + 1u] * a1 + frames[at + 2u] * a2, growth, e);
  }
  return packSkew(t);
}

// This is gradientOf() in gradient_opacity.h.
vec3 gradientOf(vec3 w, vec3 axis, vec3 shear) {
  vec3 g;
  g.z = w.z / axis.z;
  g.y = w.y / axis.y - shear.z * g.z;
  g.x = w.x / axis.x - shear.x * g.y - shear.y * g.z;
  return g / scale.xyz;
}

// This is GradientOpacity::of().
float opacityOf(vec3 gradient) {
  if (steepness_points == 0u) return 1.0;
  float magnitude = length(gradient);
  uint first = 0u, end = steepness_points;  // the first that is not less
  while (first < end) {
    uint middle = (first + end) / 2u;
    if (shading[2u * middle] < magnitude)
      first = middle + 1u;
    else
      end = middle;
  }
  if (first == 0u) return shading[1];
  uint before = 2u * first - 2u;
  if (first == steepness_points) return shading[before + 1u];
  float part = (magnitude - shading[before]) / (shading[before + 2u] - shading[before]);
  return shading[before + 1u] + part * (shading[before + 3u] - shading[before + 1u]);
}

// This is LocalShadows::at().
float arrivingAt(uint p, vec3 position) {
  if (lattice_nodes.x == 0) return 1.0;
  vec3 last = vec3(lattice_nodes - 1), at = uintBitsToFloat(parts[p + 5u].xyz) + nodes_per_unit.xyz * position;
  vec3 inside = clamp(at, vec3(0.0), last), node = min(floor(inside), last - 1.0), part = inside - node;
  ivec3 corner = ivec3(node);
  int row = lattice_nodes.x, layer = row * lattice_nodes.y, from = 2 * int(steepness_points) + corner.z * layer + corner.y * row + corner.x;
  vec4 along = mix(vec4(shading[from], shading[from + row], shading[from + layer], shading[from + layer + row]),
                   vec4(shading[from + 1], shading[from + row + 1], shading[from + layer + 1], shading[from + layer + row + 1]), part.x);
  vec2 sides = mix(along.xz, along.yw, part.y);
  return mix(sides.x, sides.y, part.z);
}

// This is LocalLight::of(): diffuse and specular. `towards_viewer` has unit length.
vec2 litBy(vec3 g, vec3 towards_viewer) {
  float squared = dot(g, g);
  if (!(squared > 0.0 && squared < 1e36)) return vec2(1.0, 0.0);
  float strength = squared / (squared + light.w), inverse = inversesqrt(squared);
  vec3 towards = light_at_viewer ? towards_viewer : light_towards.xyz;
  float facing = min(1.0, inverse * abs(dot(g, towards))), shine = facing;
  if (!light_at_viewer) {
    vec3 middle_way = towards + towards_viewer;
    float far = length(middle_way);
    shine = far > 1e-6 ? min(1.0, inverse * abs(dot(g, middle_way)) / far) : 0.0;
  }
  for (int n = 0; n < 5; ++n) shine *= shine;
  return vec2(1.0 - strength + strength * (light.x + light.y * facing), strength * light.z * shine);
}

// This is packLit().
float withLight(float half_width, vec2 by) {
  uint bits = floatBitsToUint(max(half_width, 1.17549435e-38)) & 0xffff0000u;
  uvec2 shares = uvec2(clamp(by, 0.0, 1.0) * vec2(511.0, 127.0) + 0.5);
  return uintBitsToFloat(bits | shares.x << 7 | shares.y);
}

float cellOf(float value) {
  float v = log_scale ? log(max(value, least_logarithmic)) : value;
  return v * cells_from_scalar.x + cells_from_scalar.y;
}
float extinctionTo(float x) {
  int cell = int(clamp(x, 0.0, float(cells)));
  return texelFetch(classes, cell).w + below.w * min(x, 0.0) + above.w * max(x - float(cells), 0.0);
}
// A cell more to both sides, as ClassificationTable::fullyTransparent().
bool isTransparent(float low, float high) {
  float from = min(floor(cellOf(low)) - 1.0, float(cells)), to = max(floor(cellOf(high)) + 2.0, 0.0);
  return extinctionTo(max(to, from + 1.0)) - extinctionTo(from) <= 0.0;
}

// The first key of any tile that the splat touches; as setFirst() in tile_key.h, which says why.
uint firstKey(vec2 at, Ellipse e, inout uint key, inout vec2 slope) {
  if (slope == vec2(0.0)) return key;
  vec2 reach = SUPPORT * vec2(e.l11, length(vec2(e.l21, e.l22)));
  vec2 from = floor((at - reach) / SIDE), to = floor((at + reach) / SIDE);
  vec2 least = min(slope * (from * SIDE + 0.5 * SIDE - at), slope * (to * SIDE + 0.5 * SIDE - at));
  vec2 over = vec2(e.l11 * slope.x + e.l21 * slope.y, e.l22 * slope.y);
  float most = SUPPORT * length(over) + 0.5 * SIDE * (abs(slope.x) + abs(slope.y)) + 1.0;
  float before = min(1.0 - (least.x + least.y), most);
  uint first = before > 0.0 ? key - min(key, uint(min(before, 1073741824.0))) : key + uint(min(-before, 1073741824.0));
  if (from == to) {
    key = first;
    slope = vec2(0.0);
  }
  return first;
}

#define OF(array) uintBitsToFloat(words[at + uint(array) * n])
#define VALUE_OF(array) uintBitsToFloat(values[of + uint(array) * n])

// The place of a splat on the screen, and the map that is linear there: a PlacedPiece, with its depth as BrickProjector::depths().
struct Place {
  vec2 pixel;
  float depth, volume, layer_depth;  // layer_depth: as PixelLayers count it
  vec3 row0, row1, to_depth, depth_row;
};

Place placeOf(uint p, vec3 position) {
  Place place;
#if PERSPECTIVE
  vec4 part2 = uintBitsToFloat(parts[p + 2u]);
  vec3 c = part2.xyz + vec3(dot(right.xyz, position), dot(down.xyz, position), dot(forward.xyz, position));
  vec2 tangent = c.xy / c.z;
  place.pixel = middle + focal * tangent;
  place.depth = (part2.w + dot(forward.xyz, position)) / (uintBitsToFloat(parts[p + 3u].x) * c.z);
  place.row0 = focal / c.z * (right.xyz - tangent.x * forward.xyz);
  place.row1 = focal / c.z * (down.xyz - tangent.y * forward.xyz);
  place.to_depth = focal / c.z * forward.xyz;
  float distance = length(c);
  place.volume = volume * focal * focal * distance / (c.z * c.z * c.z);
  place.layer_depth = distance;
  place.depth_row = (c.x * right.xyz + c.y * down.xyz + c.z * forward.xyz) / max(distance, 1e-30);
#else
  place.row0 = right.xyz;
  place.row1 = down.xyz;
  place.to_depth = focal * forward.xyz;
  place.pixel = uintBitsToFloat(parts[p + 1u].zw) + vec2(dot(place.row0, position), dot(place.row1, position));
  place.depth = dot(forward.xyz, position);
  place.volume = volume;
  place.layer_depth = place.depth + uintBitsToFloat(parts[p + 4u].w);
  place.depth_row = forward.xyz;
#endif
  return place;
}

vec3 rowOf(vec3 row, mat3 a) {
  return vec3(dot(row, a[0]), dot(row, a[1]), dot(row, a[2]));
}

Ellipse ellipseAt(Place place, mat3 a, vec3 w, float variance, float weight) {
  return ellipseOf(rowOf(place.row0, a), rowOf(place.row1, a), w, variance, weight * place.volume);
}

// A is the matrix of these columns.
mat3 factorOf(vec3 axis, vec3 shear) {
  return mat3(axis.x * vec3(1.0, shear.x, shear.y), axis.y * vec3(0.0, 1.0, shear.z), vec3(0.0, 0.0, axis.z));
}

// A splat, or a piece of one.
struct Projected {
  Ellipse e;
  float mean;
  uint skew;
  vec2 slope;  // of the plane that it lies in
  vec2 lit_by;
  bool is_cut;  // its record lies before it
};

// Writes a splat that can be seen, with its keys, as SplatChooser::chooseWith(). Returns which of `fates` counts it.
uint choose(uint slot, uint p, Place at, Projected splat) {
  Ellipse e = splat.e;
  float mean = splat.mean;
  vec2 slope = splat.slope;
  vec2 reach_px = SUPPORT * vec2(e.l11, abs(e.l21) + e.l22);
  if (!(all(greaterThan(at.pixel + reach_px, vec2(0.0))) && all(lessThan(at.pixel - reach_px, picture)))) return 0u;
  if (!per_pixel) e.slope0 = e.slope1 = e.half_width = e.along = 0.0;
  float spread = SUPPORT * (abs(e.slope0) + abs(e.slope1)) + (splat.is_cut ? CUT_REACH / 1.7320508 : 1.0) * e.half_width;
  if (!(abs(mean) + spread <= largest_scalar)) {
    e.slope0 = e.slope1 = e.half_width = e.along = spread = 0.0;
    mean = clamp(mean, -largest_scalar, largest_scalar);
  }
  e.amplitude = min(e.amplitude, 1e30);
  if (!(e.amplitude > 0.0) || isTransparent(mean - spread, mean + spread)) return 1u;
  if (lit) e.half_width = withLight(e.half_width, splat.lit_by);
#if PERSPECTIVE
  slope *= key_steps_a_pixel * (uintBitsToFloat(parts[p].w) - at.depth);
#else
  slope *= key_steps_a_pixel;
#endif
  uvec2 keys = parts[p + 1u].xy;
  uint key = uint(clamp(int(parts[p].z) + int(at.depth * key_steps), 0, MOST_KEY));
  uint first = clamp(firstKey(at.pixel, e, key, slope), keys.x, keys.y);
  key = clamp(key, keys.x, keys.y);
  splats[slot] = floatBitsToUint(vec4(at.pixel, e.l11, e.l21));
  splats[slot + 1u] = floatBitsToUint(vec4(e.l22, splat.is_cut ? -e.amplitude : e.amplitude, mean, e.slope0));
  splats[slot + 2u] = uvec4(floatBitsToUint(vec2(e.slope1, e.half_width)), splat.skew, floatBitsToUint(e.along));
  splats[slot + 3u] = uvec4(key, first, floatBitsToUint(slope));
  return 2u;
}

vec2 litAt(uint p, vec3 position, vec3 gradient) {
  if (!lit) return vec2(1.0, 0.0);
#if PERSPECTIVE
  vec3 towards_viewer = normalize(uintBitsToFloat(parts[p + 3u].yzw) - scale.xyz * position);
#else
  vec3 towards_viewer = viewer.xyz;
#endif
  return arrivingAt(p, position) * litBy(gradient, towards_viewer);
}

// A record, which is not drawn.
void writeNothing(uint slot) {
  splats[slot] = uvec4(0u, 0u, floatBitsToUint(-1.0), 0u);
}
)";

}  // namespace

std::string projectShader(bool perspective) {
  const std::string constants = fmt::format(
      "#define THREADS {}\n#define PERSPECTIVE {:d}\n#define KERNEL_SIGMA {:.9g}\n#define KERNEL_VARIANCE "
      "{:.9g}\n"
      "#define SUPPORT {:.9g}\n#define STEEPEST {:.9g}\n#define SIDE {:.1f}\n#define NO_BORDER {}u\n",
      kProjectThreads, perspective, kKernelSigma, kKernelSigma * kKernelSigma,
      static_cast<float>(kKernelSupport), static_cast<float>(kSteepest), static_cast<float>(kOrderSide),
      kNoBorder);
  const std::string growth = fmt::format(
      "#define FRAME_SHIFT {}\n#define FRAME_MASK {}u\n#define GROWTH_BITS {}u\n#define GROWTH_STEP {:.9g}\n"
      "#define SKEW_OF_GROWTH {:.9g}\n#define MOST_KEY {}\n",
      kGrowthFrameShift, (1u << kGrowthFrameBits) - 1, kGrowthBits, kGrowthStep, kSkewOfGrowth,
      INT32_MAX / 2);
  const std::string sizes = fmt::format(
      "#define PART_VECTORS {}u\n#define FATES {}u\n#define CUT_REACH {:.9g}\n#define GEOMETRY_ARRAYS {}u\n"
      "#define VALUE_ARRAYS {}u\n",
      sizeof(ShaderPart) / 16, kFates, ScreenCut::kReach, kGeometryArrays, kValueArrays);
  return fmt::format("#version 430 core\n{}{}{}{}{}{}{}{}", constants, growth, sizes, splatUniforms(),
                     kInputs, pieceInputs(), kProjectBody, pieceFunctions());
}

}  // namespace curvisplat
