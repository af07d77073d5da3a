// Cuts splats that are too close to a perspective viewer for their size.
//
// A splat is halved along the longest column of A: that column and the slope along it become half, the weight
// half, and the two centres lie a quarter of the column from the old one, with means a quarter of the slope
// apart from it. Merging the two (DESIGN.md, "Merging") gives the splat back exactly, residual variance
// included; and a pencil of aspect ratio 1000 is cut across only, where eight octants would cut it to dust.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/vec3.hpp>

#include "render/project/footprint_skew.h"
#include "render/project/splat_ellipse.h"
#include "render/project/splat_maps.h"

namespace curvisplat {

/// A plane that a splat is cut at, in the frame of the splat's A: of a point A u from its centre, what has
/// inward · u < -distance is not drawn.
struct CutFace {
  glm::vec3 inward;  // unit length
  float distance;
  bool edge_on = false;  // cuts little enough to be left out where it is not seen at a low angle
};
/// The borders of a cell, and clip planes.
struct CutFaces {
  static constexpr int kMax = 6;

  std::array<CutFace, kMax> face;
  int count = 0;

  const CutFace* begin() const { return face.data(); }
  const CutFace* end() const { return face.data() + count; }
  /// In the place of the face that takes the least, where there are kMax.
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
};

/// Halves `piece` along `column` (0..2).
std::array<SplatPiece, 2> halve(const SplatPiece& piece, int column);

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

}  // namespace curvisplat
