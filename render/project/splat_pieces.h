// The pieces that a splat is drawn in, and where they lie on the screen. Most splats are one piece; cells at
// borders are cut at faces or drawn in several parts, and what is too close to a perspective viewer for its
// size is halved.
//
//   partsAtBorder -> place, which cuts up in perspective (cutUp) -> take(piece, its place and linear map)
//
// The maps are a view's projection for one brick, in float and relative to the brick's origin. The pieces
// that perspective makes merge into the splat exactly, in all moments. A part of projection.cpp: most is
// inline, for the loop over a brick's splats. Pure; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "render/project/footprint.h"
#include "render/project/screen_view.h"
#include "stream/model/border_code.h"

namespace curvisplat {

/// One linear map for all splats of a brick.
struct OrthographicMap {
  float x, y;       // the origin, pixels
  ScreenRows rows;  // pixels to a unit of the data
  glm::vec3 depth;  // stretched units along the view
  float focal_px;
  float volume;  // pixels² and stretched depth to a unit cubed of the data
  LowPass low_pass;

  OrthographicMap(const ScreenView& view, const glm::dvec3& origin);

  /// Depth per unit of the data.
  glm::vec3 depthRow(float, float, float) const { return depth; }
  /// Depth in pixels per unit of the data.
  glm::vec3 depthPixels(float, float, float) const { return focal_px * depth; }
};

/// The local affine map of each splat (Zwicker et al., "EWA Volume Splatting", 2001), with the distance from
/// the eye as depth: det M = focal² |c| / z³ at c in view axes.
struct PerspectiveMap {
  struct Centre {
    float x, y, z;   // view axes: right, down, forward; stretched units
    float distance;  // from the eye
  };

  glm::vec3 origin;                // in view axes
  glm::vec3 right, down, forward;  // stretched view axes to a unit of the data
  glm::vec3 scale;
  float middle_x, middle_y, focal_px;
  float volume;  // the stretch's
  float near, widest;
  LowPass low_pass;
  float order_base, from_base;  // view.orderBase(); how far the origin is behind it
  float tangent_x, tangent_y;   // of the image's edges, the low-pass' reach added
  float slant_x, slant_y;       // √(1 + tangent²)

  /// `coarseness` multiplies the near plane's distance and the view's `widest`.
  PerspectiveMap(const ScreenView& view, const glm::dvec3& origin, float coarseness);

  Centre centreOf(float x_, float y_, float z_) const {
    const float x = origin.x + right.x * x_ + right.y * y_ + right.z * z_;
    const float y = origin.y + down.x * x_ + down.y * y_ + down.z * z_;
    const float z = origin.z + forward.x * x_ + forward.y * y_ + forward.z * z_;
    return {x, y, z, std::sqrt(x * x + y * y + z * z)};
  }

  float pixelX(const Centre& c) const { return middle_x + focal_px * c.x / c.z; }
  float pixelY(const Centre& c) const { return middle_y + focal_px * c.y / c.z; }

  ScreenRows rowsAt(const Centre& c) const {
    const float pixels = focal_px / c.z, x = c.x / c.z, y = c.y / c.z;
    return {pixels * (right.x - x * forward.x), pixels * (right.y - x * forward.y),
            pixels * (right.z - x * forward.z), pixels * (down.x - y * forward.x),
            pixels * (down.y - y * forward.y),  pixels * (down.z - y * forward.z)};
  }

  /// Depth, the distance from the eye, per unit of the data.
  glm::vec3 depthRowAt(const Centre& c) const {
    return (c.x * right + c.y * down + c.z * forward) / std::max(c.distance, 1e-30f);
  }
  glm::vec3 depthRow(float x, float y, float z) const { return depthRowAt(centreOf(x, y, z)); }
  /// Depth along the view in pixels, those at the centre, per unit of the data.
  glm::vec3 depthPixels(float x, float y, float z) const { return focal_px / centreOf(x, y, z).z * forward; }
  /// The number that orders splats: 1 / order_base - 1 / z, without cancellation.
  float orderAt(const Centre& c, float x, float y, float z) const {
    return (from_base + forward.x * x + forward.y * y + forward.z * z) / (order_base * c.z);
  }

  float volumeAt(const Centre& c) const {
    return volume * focal_px * focal_px * c.distance / (c.z * c.z * c.z);
  }

  /// Squared lengths of A's columns, stretched.
  glm::vec3 columns2(const Shape& s) const {
    const float x2 = scale.x * scale.x, y2 = scale.y * scale.y, z2 = scale.z * scale.z;
    return {s.axis0 * s.axis0 * (x2 + y2 * s.shear10 * s.shear10 + z2 * s.shear20 * s.shear20),
            s.axis1 * s.axis1 * (y2 + z2 * s.shear21 * s.shear21), s.axis2 * s.axis2 * z2};
  }
  /// No part of the splat's support is farther from its centre. Stretched units.
  float radiusOf(const Shape& shape) const {
    const glm::vec3 c = columns2(shape);
    return static_cast<float>(kKernelSupport) * std::sqrt(c.x + c.y + c.z);
  }
  bool tooWide(const Centre& c, float radius) const { return !(c.z >= near) | !(radius <= widest * c.z); }
  /// No part of a ball around the centre can show.
  bool outOfSight(const Centre& c, float radius) const {
    return c.z + radius <= near || std::abs(c.x) - tangent_x * c.z > radius * slant_x ||
           std::abs(c.y) - tangent_y * c.z > radius * slant_y;
  }
};

/// A plane that a splat is cut at, in the frame of the splat's A: of a point A u from its centre, what has
/// inward · u < -distance is not drawn.
struct CutFace {
  glm::vec3 inward;  // unit length
  float distance;
  bool edge_on = false;  // cuts little enough to be left out where it is not seen at a low angle
};
/// The faces of a splat: the borders of a cell, and clip planes.
struct CutFaces {
  static constexpr int kMax = 6;

  std::array<CutFace, kMax> face;
  int count = 0;

  const CutFace* begin() const { return face.data(); }
  const CutFace* end() const { return face.data() + count; }
  /// Adds a face. Where there are kMax, it replaces the one that takes the least, if it takes more.
  void add(const CutFace& added) {
    if (count < kMax) {
      face[static_cast<size_t>(count++)] = added;
      return;
    }
    CutFace* const least = std::max_element(
        face.begin(), face.end(), [](const CutFace& a, const CutFace& b) { return a.distance < b.distance; });
    if (added.distance < least->distance) *least = added;
  }
};

/// A splat or a part of one. Positions from the brick's origin; the residual variance is that of the whole.
struct SplatPiece {
  glm::vec3 position;
  Shape shape;
  Slope slope;
  float mean;
  float weight;
  CutFaces faces = {};
  GrowthAxes growth = {};  // none of what perspective cuts
  glm::vec3 across{0.0f};  // of a plate: from one face to the other, as CutFace::inward but of any length
};

/// Splat `i`, which is not cut.
inline SplatPiece wholeOf(const GeometryArrays<const float>& geometry,
                          const VariableArrays<const float>& variable, size_t i) {
  return {{geometry.x[i], geometry.y[i], geometry.z[i]},
          shapeOf(geometry, i),
          slopeOf(variable, i),
          variable.mean[i],
          geometry.weight[i],
          {},
          growthAxes(shapeOf(geometry, i), geometry.growth_code[i])};
}

/// Halves `piece` along `column` (0..2) of A: that column, the slope along it and the weight become half,
/// and the two centres lie a quarter of the column from the old one, with means a quarter of the slope apart
/// from it. Merging the two (DESIGN.md, "Merging") gives the splat back exactly, residual variance included.
std::array<SplatPiece, 2> halve(const SplatPiece& piece, int column);

/// Cuts a splat that is too close to a perspective viewer for its size, always along its longest column: a
/// pencil of aspect ratio 1000 is cut across only, where eight octants would cut it to dust.
///
/// Calls take(piece, centre) for the parts of `piece` that are small for their distance and may be in sight.
/// Returns false as soon as take() does, or when `looks_left`, which it counts down, reaches zero: a splat
/// that is very large for its distance has endless parts, few of which are taken. Splats that are too large
/// or too far for their squares to be floats are left out; no cache of this program has them.
template <typename Take>
bool cutUp(const PerspectiveMap& map, const SplatPiece& piece, size_t& looks_left, const Take& take) {
  if (looks_left == 0) return false;
  --looks_left;
  const auto centre = map.centreOf(piece.position.x, piece.position.y, piece.position.z);
  const glm::vec3 columns2 = map.columns2(piece.shape);
  const float radius = map.radiusOf(piece.shape);
  if (!std::isfinite(radius) || !std::isfinite(centre.distance)) return true;
  if (map.outOfSight(centre, radius)) return true;
  if (!map.tooWide(centre, radius)) return take(piece, centre);
  if (centre.z < map.near && radius <= map.widest * map.near)
    return true;  // small, and before the near plane
  int longest = columns2[1] > columns2[0] ? 1 : 0;
  if (columns2[2] > columns2[longest]) longest = 2;
  for (const SplatPiece& half : halve(piece, longest))
    if (!cutUp(map, half, looks_left, take)) return false;
  return true;
}

/// The pieces of a splat at borders: at most two parts along each of three axes.
using BorderPieces = std::array<SplatPiece, 8>;

/// How the splat of a cell at a border is drawn. Along each axis that ends at a face it is one wider splat
/// that is cut at the face. Along the other axes it is drawn in two parts, which follow a border more
/// closely than one symmetric kernel can (stream/model/border_code.h). Writes the parts of `whole` to
/// pieces[0 .. n - 1] and returns n: 1, 2, 4 or 8.
size_t partsAtBorder(const SplatPiece& whole, uint32_t border_code, const BorderStyle& style,
                     BorderPieces& pieces);
/// Does so by inwardAxes() and layersOf() of its code.
size_t partsAtBorder(const SplatPiece& whole, const InwardAxes& inward, uint32_t layers,
                     const BorderStyle& style, BorderPieces& pieces);

/// The place of a piece on the screen, and the map that is linear there.
struct PlacedPiece {
  float x, y, depth, volume;
  ScreenRows rows;
  glm::vec3 depth_row;
  float order;  // BrickProjector::depths()
};

/// Calls take(piece, its place) for what is to be drawn of `piece`: under the one map of an orthographic
/// view, or under perspective's local ones, which may cut it up. Returns false as soon as take() does, or
/// when `looks`, the pieces that may still be looked at, has been counted down to zero.
template <typename Take>
bool place(const OrthographicMap& map, const SplatPiece& piece, size_t&, const Take& take) {
  const float x = piece.position.x, y = piece.position.y, z = piece.position.z;
  const float depth = map.depth.x * x + map.depth.y * y + map.depth.z * z;
  return take(piece, PlacedPiece{map.x + map.rows.x0 * x + map.rows.y0 * y + map.rows.z0 * z,
                                 map.y + map.rows.x1 * x + map.rows.y1 * y + map.rows.z1 * z, depth,
                                 map.volume, map.rows, map.depth, depth});
}
template <typename Take>
bool place(const PerspectiveMap& map, const SplatPiece& piece, size_t& looks, const Take& take) {
  return cutUp(map, piece, looks, [&](const SplatPiece& part, const PerspectiveMap::Centre& centre) {
    return take(part, PlacedPiece{map.pixelX(centre), map.pixelY(centre), centre.distance,
                                  map.volumeAt(centre), map.rowsAt(centre), map.depthRowAt(centre),
                                  map.orderAt(centre, part.position.x, part.position.y, part.position.z)});
  });
}

/// The map's rows at a position.
inline const ScreenRows& rowsAt(const OrthographicMap& map, float, float, float) {
  return map.rows;
}
inline ScreenRows rowsAt(const PerspectiveMap& map, float x, float y, float z) {
  return map.rowsAt(map.centreOf(x, y, z));
}

}  // namespace curvisplat
