// Where the pieces of splats lie on the screen: under the one map of an orthographic view, or under perspective's local
// ones, which may cut a piece up. A part of projection.cpp.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>

#include "render/project/splat_cutter.h"
#include "render/project/splat_ellipse.h"
#include "render/project/splat_maps.h"

namespace curvisplat {

/// Where a piece lies, and the map that is linear there.
struct PlacedPiece {
  float x, y, depth, volume;
  ScreenRows rows;
  glm::vec3 depth_row;
};

/// Calls take(piece, its place) for what is to be drawn of `piece`; false as soon as take() gives it, or
/// after more `looks` at pieces, which it counts down.
template <typename Take>
bool place(const OrthographicMap& map, const SplatPiece& piece, size_t&, const Take& take) {
  const float x = piece.position.x, y = piece.position.y, z = piece.position.z;
  return take(piece, PlacedPiece{map.x + map.rows.x0 * x + map.rows.y0 * y + map.rows.z0 * z,
                                 map.y + map.rows.x1 * x + map.rows.y1 * y + map.rows.z1 * z,
                                 map.depth.x * x + map.depth.y * y + map.depth.z * z, map.volume, map.rows,
                                 map.depth});
}
template <typename Take>
bool place(const PerspectiveMap& map, const SplatPiece& piece, size_t& looks, const Take& take) {
  return cutUp(map, piece, looks, [&](const SplatPiece& part, const PerspectiveMap::Centre& centre) {
    return take(part, PlacedPiece{map.pixelX(centre), map.pixelY(centre), centre.distance,
                                  map.volumeAt(centre), map.rowsAt(centre), map.depthRowAt(centre)});
  });
}

// The map's rows at a position.
inline const ScreenRows& rowsAt(const OrthographicMap& map, float, float, float) {
  return map.rows;
}
inline ScreenRows rowsAt(const PerspectiveMap& map, float x, float y, float z) {
  return map.rowsAt(map.centreOf(x, y, z));
}

}  // namespace curvisplat
