#include "render/gl/project_pieces.h"

#include <fmt/format.h>

#include "render/project/pixel_layers.h"
#include "render/project/plane_cuts.h"
#include "render/project/record_tags.h"
#include "render/project/screen_splat.h"
#include "stream/model/border_code.h"
#include "stream/model/kernel.h"

namespace curvisplat {
namespace {

constexpr const char* kPieceInputs = R"(
uniform samplerBuffer layer_bounds;  // PixelLayers::allBounds()
uniform uint colour_records;  // 1 in pictures of two scalars, else 0
)";

constexpr const char* kFunctions = R"(
// A part's records: ShaderPart::kinds.
uint planesOf(uint p) {
  return parts[p + 4u].z & 255u;
}
uint layeredOf(uint p) {
  return parts[p + 4u].z >> 8 & 1u;
}
bool isLayered(uint p) {
  return layeredOf(p) != 0u;
}
// A plane that may cut a part's splats: normal, offset.
vec4 planeAt(uint n) {
  return uintBitsToFloat(parts[n]);
}
// StoredPart::elementsASplat(), elementsAPiece().
uint elementsASplat(uint p) {
  return 1u + min(planesOf(p), 1u) + layeredOf(p) + colour_records;
}
uint elementsAPiece(uint p) {
  return 2u + layeredOf(p) + colour_records;
}

const uint kInside = 0u, kAcross = 1u, kOutside = 2u;

// This is LocalClipPlanes::sidesOf().
uint sideOfPlanes(uint p, vec3 position, mat3 a, float support) {
  uint side = kInside, first = parts[p + 4u].y;
  for (uint n = first; n < first + planesOf(p); ++n) {
    vec4 plane = planeAt(n);
    float distance = dot(plane.xyz, position) + plane.w, reach = support * length(rowOf(plane.xyz, a));
    side = max(side, distance >= reach ? kInside : distance > -reach ? kAcross : kOutside);
  }
  return side;
}

// This is PixelLayers::boundsOver().
vec2 boundsOver(vec2 from, vec2 to) {
  if (!all(lessThanEqual(from, to))) return vec2(-3.4e38, 3.4e38);  // no numbers: anywhere
  ivec2 least = ivec2(clamp(from, vec2(0.0), picture - 1.0)) / LAYER_CELL, most = ivec2(clamp(to, vec2(0.0), picture - 1.0)) / LAYER_CELL;
  ivec2 cells = (ivec2(picture) + LAYER_CELL - 1) / LAYER_CELL;
  int begin = 0;
  for (int level = 0; level < 24 && any(greaterThan(most - least, ivec2(1))); ++level) {
    begin += cells.x * cells.y;
    cells = (cells + 1) / 2;
    least /= 2;
    most /= 2;
  }
  vec2 bounds = texelFetch(layer_bounds, begin + least.y * cells.x + least.x).xy;
  for (int y = least.y; y <= most.y; ++y)
    for (int x = least.x; x <= most.x; ++x) {
      vec2 cell = texelFetch(layer_bounds, begin + y * cells.x + x).xy;
      bounds = vec2(min(bounds.x, cell.x), max(bounds.y, cell.y));
    }
  return bounds;
}

// This is LocalLayers::sideOf(): kInside before all layers, kOutside behind opaque ones.
uint sideOfLayers(uint p, Place at, Ellipse e, mat3 a) {
  if (!isLayered(p)) return kInside;
  float reach = DEPTH_REACH * length(rowOf(at.depth_row, a));
  vec2 reach_px = SUPPORT * vec2(e.l11, abs(e.l21) + e.l22), bounds = boundsOver(at.pixel - reach_px, at.pixel + reach_px);
  if (at.layer_depth + reach <= bounds.x) return kInside;
  return at.layer_depth - reach >= bounds.y ? kOutside : kAcross;
}

// B's rows, and a field that is linear in space as the pixels see it; plane_cuts.cpp explains them.
struct Ray {
  vec3 b0, b1, along;
  float s00, s11, nn, determinant;
};
Ray rayOf(vec3 b0, vec3 b1) {
  vec3 n = cross(b0, b1);
  float s00 = dot(b0, b0), s11 = dot(b1, b1), nn = dot(n, n);
  return Ray(b0, b1, n, s00, s11, nn, nn + low_pass_px2 * (s00 + s11 + low_pass_px2));
}

struct Field {
  float g0, g1, hidden, along;
};
Field fieldOf(Ray ray, vec3 q) {
  float h0 = dot(ray.b0, q), h1 = dot(ray.b1, q), nq = dot(ray.along, q);
  vec3 m = cross(ray.along, q), c0 = cross(ray.b0, q), c1 = cross(ray.b1, q);
  return Field((dot(ray.b1, m) + low_pass_px2 * h0) / ray.determinant, (low_pass_px2 * h1 - dot(ray.b0, m)) / ray.determinant,
               (low_pass_px2 * (low_pass_px2 * dot(q, q) + dot(c0, c0) + dot(c1, c1)) + nq * nq) / ray.determinant, nq);
}

float correlationOf(Ray ray, vec3 w, float half_width, float steepness) {
  if (!(ray.nn > 1e-8 * ray.s00 * ray.s11 && half_width > 0.0)) return 0.0;
  float deviation = KERNEL_SIGMA * dot(w, ray.along) / sqrt(ray.nn);
  return clamp(steepness * deviation * 1.7320508 / half_width, -1.0, 1.0);
}

vec4 fourAt(uint word) {
  return uintBitsToFloat(uvec4(words[word], words[word + 1u], words[word + 2u], words[word + 3u]));
}
vec4 valuesAt(uint word) {
  return uintBitsToFloat(uvec4(values[word], values[word + 1u], values[word + 2u], values[word + 3u]));
}

// A piece of a splat, or all of it.
struct Piece {
  vec3 position, axis, shear, w;
  float mean, weight;
  uint faces, counts;  // where its own faces lie; StoredPiece::counts
};

// This is the result of cutAtFaces().
struct Cut {
  bool nothing;  // is left
  bool clipped;  // a clip plane crosses the piece
  int count;     // of the faces that cut
  mat3 faces;    // a face a column
  vec3 nearest, steepness;
  uint far_sides;
};

void addFace(inout Cut cut, Ray ray, Ellipse e, vec4 face, bool edge_on) {
  Field field = fieldOf(ray, face.xyz);
  if (edge_on && field.hidden > 0.5) return;
  float deviation = sqrt(field.hidden);
  vec3 at = vec3(face.w, e.l11 * field.g0 + e.l21 * field.g1, e.l22 * field.g1) / (KERNEL_SIGMA * deviation);
  float spread = SUPPORT * length(at.yz);
  if (at.x + spread <= -CUT_REACH) cut.nothing = true;
  if (at.x - spread >= CUT_REACH) return;
  int place = cut.count;
  if (place == 3) {  // in the place of the one that takes least
    place = cut.nearest.y > cut.nearest.x ? 1 : 0;
    if (cut.nearest.z > cut.nearest[place]) place = 2;
    if (!(at.x - spread < cut.nearest[place])) return;
  } else {
    ++cut.count;
  }
  cut.faces[place] = at;
  cut.nearest[place] = at.x - spread;
  cut.steepness[place] = abs(field.along) / (sqrt(ray.determinant) * deviation);
  cut.far_sides = cut.far_sides & ~(1u << place) | (field.along > 0.0 ? 1u << place : 0u);
}

Cut cutOf(uint p, Ray ray, Ellipse e, mat3 a, Piece piece, bool clipped) {
  Cut cut = Cut(false, false, 0, mat3(NO_FACE, 0.0, 0.0, NO_FACE, 0.0, 0.0, NO_FACE, 0.0, 0.0), vec3(0.0), vec3(0.0), 0u);
  for (uint f = 0u; f < (piece.counts & 255u); ++f)
    addFace(cut, ray, e, fourAt(piece.faces + 4u * f), (piece.counts >> (8u + f) & 1u) != 0u);
  if (!clipped) return cut;
  uint first = parts[p + 4u].y;
  for (uint n = first; n < first + planesOf(p); ++n) {  // LocalClipPlanes::addFaces()
    vec4 plane = planeAt(n);
    vec3 q = rowOf(plane.xyz, a);
    float reach = length(q);
    if (!(reach > 0.0)) continue;
    float distance = (dot(plane.xyz, piece.position) + plane.w) / reach;
    if (!(distance < SUPPORT)) continue;
    cut.clipped = true;
    addFace(cut, ray, e, vec4(q / reach, distance), false);
  }
  return cut;
}

vec3 integralsTo(float x) {
  float x2 = x * x, rest = 1.0 - x2;
  return vec3(x * (0.9375 + x2 * (-0.625 + 0.1875 * x2)), rest * rest * rest,
              x * x2 * (0.3125 + x2 * (-0.375 + 0.13392857 * x2)));
}
// The share of the depths on the ray through the centre that is left, and its deviation. This is DepthsLeft::atCentre().
vec2 leftAtCentre(Cut cut) {
  float lo = -1.0, hi = 1.0;
  for (int f = 0; f < 3; ++f) {
    float at = cut.faces[f].x / CUT_REACH;
    if ((cut.far_sides >> f & 1u) != 0u)
      lo = max(lo, -at);
    else
      hi = min(hi, at);
  }
  vec3 left = integralsTo(min(hi, 1.0)) - integralsTo(min(lo, 1.0));
  if (!(left.x > 1e-6)) return vec2(0.0);
  float mean = -5.0 / 32.0 * left.y / left.x;
  return vec2(left.x, sqrt(clamp(7.0 * (left.z / left.x - mean * mean), 0.0, 1.0)));
}

// This is shareOfAlong() in plane_cuts.h.
float shareOfAlong(Ray ray, Piece piece) {
  if ((piece.counts >> 24 & 1u) == 0u) return 1.0;
  vec3 across = fourAt(piece.faces).xyz;
  float facing = dot(ray.along, across), facing2 = facing * facing;
  float tangent2 = (ray.nn * dot(across, across) - facing2) / facing2;
  float share = 1.0 - PLATES_BEHIND * max(0.0, sqrt(max(0.0, tangent2) * ray.determinant / ray.nn) - PLATES_FROM);
  return share > 0.0 ? share : 0.0;
}

float steepest(Cut cut) {
  return max(cut.steepness.x, max(cut.steepness.y, cut.steepness.z));
}

void writeCut(uint slot, Cut cut, float correlation) {  // ScreenCut::record()
  float tag = -(FAR_SIDES_TAG * float(cut.far_sides) + CUT_TAG + correlation);
  splats[slot] = floatBitsToUint(vec4(cut.faces[0].xy, tag, cut.faces[0].z));
  splats[slot + 1u] = floatBitsToUint(vec4(cut.faces[1], cut.faces[2].x));
  splats[slot + 2u] = uvec4(floatBitsToUint(cut.faces[2].yz), 0u, 0u);
}

// The part of the depth's deviation that is along the ray.
float steepnessOfDepth(Ray ray, Field field) {
  float deviation = sqrt(ray.determinant * field.hidden);
  return deviation > 0.0 ? field.along / deviation : 0.0;
}

// This is ScreenDepth::record().
void writeDepth(uint slot, float middle, Ellipse e, Field field, float correlation, bool has_cut) {
  vec2 by = vec2(e.l11 * field.g0 + e.l21 * field.g1, e.l22 * field.g1);
  float tag = -(has_cut ? DEPTH_OF_CUT_TAG : DEPTH_TAG) - correlation;
  splats[slot] = floatBitsToUint(vec4(middle, by.x, tag, by.y));
  splats[slot + 1u] = uvec4(floatBitsToUint(min(1.0 / (KERNEL_SIGMA * sqrt(field.hidden)), 1e30)), 0u, 0u, 0u);
  splats[slot + 2u] = uvec4(0u);
}

// The scalar of the colours, kept finite as SplatChooser::inBounds() does; ScreenColour::record().
void writeColour(uint slot, float mean, Ellipse e, float correlation) {
  vec2 slopes = vec2(e.slope0, e.slope1);
  float half_width = e.half_width, along = e.along;
  if (!(abs(mean) + SUPPORT * (abs(slopes.x) + abs(slopes.y)) + half_width <= 1e22)) {
    slopes = vec2(0.0);
    half_width = along = 0.0;
    mean = clamp(mean, -1e22, 1e22);
  }
  splats[slot] = floatBitsToUint(vec4(mean, slopes.x, -COLOUR_TAG - correlation, slopes.y));
  splats[slot + 1u] = uvec4(floatBitsToUint(vec2(half_width, along)), 0u, 0u);
  splats[slot + 2u] = uvec4(0u);
}
)";

constexpr const char* kDraw = R"(
// The whole splat.
struct Splat {
  Piece piece;
  mat3 a;
  float variance, opacity;  // opacity: a factor of its extinction
  vec2 slope, lit_by;
  bool clipped;           // by planes that cross it
  float colour, colour_variance;  // the scalar of the colours: mean, variance
  vec3 colour_w;          // slope
};

// Splat `own` of the part.
Splat splatAt(uint p, uint own) {
  uint n = parts[p].y, at = parts[p].x + own, of = parts[p + 5u].w + own;
  Splat s;
  s.piece = Piece(vec3(OF(0), OF(1), OF(2)), vec3(OF(3), OF(4), OF(5)), vec3(OF(6), OF(7), OF(8)), vec3(VALUE_OF(1), VALUE_OF(2), VALUE_OF(3)),
                  VALUE_OF(0), OF(9), 0u, 0u);
  s.a = factorOf(s.piece.axis, s.piece.shear);
  s.variance = VALUE_OF(4);
  s.opacity = 1.0;
  s.slope = s.lit_by = vec2(0.0);
  s.clipped = false;
  s.colour = s.colour_variance = 0.0;
  s.colour_w = vec3(0.0);
  if (colour_records != 0u) {
    s.colour = VALUE_OF(5);
    s.colour_w = vec3(VALUE_OF(6), VALUE_OF(7), VALUE_OF(8));
    s.colour_variance = VALUE_OF(9);
  }
  return s;
}

// Whether no piece of it has extinction, wherever the piece lies. `drawn`: drawnSlope().
bool isTransparentThroughout(Splat s, float drawn) {
  float most = reach * drawn + CUT_REACH * sqrt(drawn * drawn + s.variance);
  return isTransparent(s.piece.mean - most, s.piece.mean + most);
}

// Solves by the lower triangle of A, once for each column of the piece, as withScalarOf() does.
vec3 inFrameOf(Piece whole, vec3 v) {
  vec3 u;
  u.x = v.x / whole.axis.x;
  u.y = (v.y - whole.axis.x * whole.shear.x * u.x) / whole.axis.y;
  u.z = (v.z - whole.axis.x * whole.shear.y * u.x - whole.axis.y * whole.shear.z * u.y) / whole.axis.z;
  return u;
}

// Draws a piece as choosePieces() does, into the last of `room` elements from `slot` on. Returns which of `fates` counts it.
uint drawPiece(uint slot, uint room, uint p, Splat s, Piece piece, uint skew) {
  mat3 a = factorOf(piece.axis, piece.shear);
  Place at = placeOf(p, piece.position);
  Ray ray = rayOf(rowOf(at.row0, a), rowOf(at.row1, a));
  Ellipse e = ellipseOf(ray.b0, ray.b1, piece.w, s.variance, piece.weight * at.volume);
  float share_of_along = shareOfAlong(ray, piece);
  e.along *= share_of_along;
  uint side = sideOfLayers(p, at, e, a);
  if (side == kOutside) return 0u;
  Cut cut = cutOf(p, ray, e, a, piece, s.clipped);
  if (cut.nothing) return 0u;
  bool faces = cut.count > 0, across = side == kAcross;
  vec2 left = faces ? leftAtCentre(cut) : vec2(1.0);
  float mean = piece.mean, correlation = faces ? correlationOf(ray, piece.w, e.half_width, steepest(cut)) : 0.0;
  Field depth = fieldOf(ray, across ? rowOf(at.depth_row, a) : vec3(0.0));
  float depth_steepness = across ? steepnessOfDepth(ray, depth) : 0.0;
  float depth_correlation = across ? correlationOf(ray, piece.w, e.half_width, depth_steepness) : 0.0;
  if (faces && !across && !cut.clipped && colour_records == 0u) {  // its scalar stays that of the cell
    Ellipse cell = ellipseAt(at, s.a, s.piece.w, s.variance, s.piece.weight);
    vec2 off = -vec2(dot(at.row0, s.piece.position - piece.position), dot(at.row1, s.piece.position - piece.position));
    float by_y = cell.slope1 / cell.l22, by_x = (cell.slope0 - cell.l21 * by_y) / cell.l11;
    mean = s.piece.mean + by_x * off.x + by_y * off.y;
    e.slope0 = e.l11 * by_x + e.l21 * by_y;
    e.slope1 = e.l22 * by_y;
    e.half_width = cell.half_width;
    e.along = cell.along * left.x;
    correlation = 0.0;
  } else if (!across) {
    e.along *= left.x * left.y;
  }
  e.amplitude *= s.opacity;
  uint own = slot + 4u * (room - 1u);
  uint fate = choose(own, p, at, Projected(e, mean, skew, s.slope, s.lit_by, faces || across));
  if (fate != 2u) return fate;
  if (colour_records != 0u) {
    vec3 w = s.colour_w;
    float colour = s.colour;
    if (piece.counts != 0u || piece.position != s.piece.position || piece.axis != s.piece.axis || piece.shear != s.piece.shear) {
      colour += dot(w, inFrameOf(s.piece, piece.position - s.piece.position));
      w = vec3(dot(w, inFrameOf(s.piece, a[0])), dot(w, inFrameOf(s.piece, a[1])), dot(w, inFrameOf(s.piece, a[2])));
    }
    Ellipse of_colour = ellipseOf(ray.b0, ray.b1, w, s.colour_variance, 1.0);
    of_colour.along *= across ? share_of_along : share_of_along * left.x * left.y;
    float with_depth = across ? correlationOf(ray, w, of_colour.half_width, depth_steepness)
                              : faces ? correlationOf(ray, w, of_colour.half_width, steepest(cut)) : 0.0;
    own -= 4u;
    writeColour(own, colour, of_colour, with_depth);
  }
  if (across) {
    own -= 4u;
    writeDepth(own, at.layer_depth, e, depth, depth_correlation, faces);
  }
  if (faces) writeCut(own - 4u, cut, correlation);
  return fate;
}

// Returns which of `fates` counts it.
uint project(uvec4 group, uint thread) {
  uint p = PART_VECTORS * group.x, room = elementsASplat(p), slot = 4u * (group.w + room * thread);
  uint n = parts[p].y, at = parts[p].x + group.y + thread;
  for (uint k = 0u; k < room; ++k) writeNothing(slot + 4u * k);
  if (words[at + 10u * n] != NO_BORDER) return 3u;  // it is drawn in pieces
  Splat s = splatAt(p, group.y + thread);
  uint planes_side = sideOfPlanes(p, s.piece.position, s.a, SUPPORT);
  if (planes_side == kOutside) return 4u;
  s.clipped = planes_side == kAcross;
  Place place = placeOf(p, s.piece.position);
  vec3 b0 = rowOf(place.row0, s.a), b1 = rowOf(place.row1, s.a);
  Ellipse e = ellipseOf(b0, b1, s.piece.w, s.variance, s.piece.weight * place.volume);
  uint side = s.clipped ? kInside : sideOfLayers(p, place, e, s.a);
  if (side == kOutside) return 5u;
  vec3 gradient = gradientOf(s.piece.w, s.piece.axis, s.piece.shear);
  s.opacity = opacityOf(gradient);
  if (!(s.opacity > 0.0)) return 1u;
  if ((s.clipped || side == kAcross) && isTransparentThroughout(s, length(s.piece.w))) return 1u;
  s.slope = planeOf(b0, b1, rowOf(place.to_depth, s.a));
  s.lit_by = litAt(p, s.piece.position, gradient);
  uint skew = skewOf(words[at + 11u * n], vec2(b0.x, b1.x), vec2(b0.y, b1.y), vec2(b0.z, b1.z), e);
  return drawPiece(slot, room, p, s, s.piece, skew);
}

// This draws a splat in pieces. Returns which of `fates` counts it.
uint projectPieces(uvec4 group, uint thread) {
  uint p = PART_VECTORS * group.x, n = parts[p].y, room = elementsAPiece(p);
  uint table = parts[p].x + GEOMETRY_ARRAYS * n, own = table + 3u * (group.y + thread);
  uint slopes = parts[p + 5u].w + VALUE_ARRAYS * (1u + colour_records) * n;
  uint first = words[own + 1u], count = words[own + 2u];
  uint slot = 4u * (group.w + room * first);
  for (uint k = 0u; k < room * count; ++k) writeNothing(slot + 4u * k);
  Splat s = splatAt(p, words[own]);
  uint planes_side = sideOfPlanes(p, s.piece.position, s.a, SUPPORT_AT_BORDER);
  if (planes_side == kOutside) return 4u;
  s.clipped = planes_side == kAcross;
  vec3 gradient = gradientOf(s.piece.w, s.piece.axis, s.piece.shear);
  s.opacity = opacityOf(gradient);
  if (!(s.opacity > 0.0) || isTransparentThroughout(s, uintBitsToFloat(values[slopes + group.y + thread]))) return 1u;
  Place whole = placeOf(p, s.piece.position);
  s.slope = planeOf(rowOf(whole.row0, s.a), rowOf(whole.row1, s.a), rowOf(whole.to_depth, s.a));
  s.lit_by = litAt(p, s.piece.position, gradient);
  uint best = 0u, at = table + 3u * parts[p + 4u].x + 36u * first, scalar_at = slopes + parts[p + 4u].x + 4u * first;
  for (uint k = 0u; k < count; ++k, at += 36u, scalar_at += 4u, slot += 4u * room) {
    vec4 q0 = fourAt(at), q1 = fourAt(at + 4u), q2 = fourAt(at + 8u), of = valuesAt(scalar_at);
    Piece piece = Piece(q0.xyz, q1.xyz, q2.xyz, of.yzw, of.x, q0.w, at + 12u, words[at + 7u]);
    Place place = placeOf(p, piece.position);
    mat3 a = factorOf(piece.axis, piece.shear);
    Ellipse e = ellipseAt(place, a, piece.w, s.variance, piece.weight);
    vec4 t = vec4(0.0);
    for (uint g = 0u; g < (piece.counts >> 16 & 255u); ++g) {
      vec4 growth = fourAt(at + 24u + 4u * g);
      t += skewOfAxis(vec2(dot(place.row0, growth.xyz), dot(place.row1, growth.xyz)), growth.w, e);
    }
    best = max(best, drawPiece(slot, room, p, s, piece, packSkew(t)));
  }
  return best;
}

void main() {
  uint thread = gl_LocalInvocationID.x, number = gl_WorkGroupID.x + gl_WorkGroupID.y * gl_NumWorkGroups.x;
  if (thread < FATES) group_fates[thread] = 0u;
  memoryBarrierShared();
  barrier();
  uvec4 group = number < group_count ? groups[first_group + number] : uvec4(0u);
  if (thread < group.z) {
    uint fate = number < groups_of_splats ? project(group, thread) : projectPieces(group, thread);
    atomicAdd(group_fates[fate], 1u);
  }
  memoryBarrierShared();
  barrier();
  bool is_counted = (parts[PART_VECTORS * group.x + 4u].z >> 9 & 1u) != 0u;
  if (is_counted && thread < FATES && group_fates[thread] > 0u) atomicAdd(fates[thread], group_fates[thread]);
}
)";

}  // namespace

std::string pieceInputs() {
  return kPieceInputs;
}

std::string pieceFunctions() {
  return fmt::format(
      "#define NO_FACE {:.1f}\n#define CUT_TAG {:.1f}\n#define FAR_SIDES_TAG {:.1f}\n#define "
      "SUPPORT_AT_BORDER {:.9g}\n"
      "#define DEPTH_REACH {:.9g}\n#define DEPTH_TAG {:.1f}\n#define DEPTH_OF_CUT_TAG {:.1f}\n"
      "#define COLOUR_TAG {:.1f}\n#define LAYER_CELL {}\n#define PLATES_BEHIND {:.9g}\n#define PLATES_FROM "
      "{:.9g}\n{}{}",
      ScreenCut::kNoFace, kCutTag, kFarSidesTag, static_cast<float>(kKernelSupport + kMergedReach),
      kDepthReach, kDepthTag, kDepthOfCutTag, kColourTag, PixelLayers::kCellSide, kPlatesBehind, kPlatesFrom,
      kFunctions, kDraw);
}

}  // namespace curvisplat
