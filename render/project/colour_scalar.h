// The scalar of the colours on the screen, in pictures of two scalars: ScreenColours. A part of projection.cpp.
#pragma once

#include <cstring>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include "render/project/face_cut.h"
#include "render/project/placed_piece.h"
#include "render/project/screen_splat.h"

namespace curvisplat {

/// The scalar of the colours on the screen, of a piece that has it as its scalar. `faces`, `across`: what cuts the piece.
template <typename Map>
ScreenColour colourOf(const Map& map, const PlacedPiece& at, const SplatPiece& piece, float variance,
                      bool faces, bool across) {
  const Ellipse e =
      ellipseOf(at.rows, piece.shape, piece.slope, variance, piece.weight * at.volume, map.low_pass);
  ScreenColour colour{piece.mean, {e.slope0, e.slope1}, e.half_width, 0};
  if (across) {
    colour.correlation =
        depthAlongRay(at.rows, at.depth_row, at.depth, piece, e, map.low_pass.footprint_px2).correlation;
  } else if (faces) {
    ScreenCut cut;
    cutAtFaces(at.rows, piece, e, map.low_pass.footprint_px2, cut);
    colour.correlation = cut.correlation;
  }
  return colour;
}

inline glm::dmat3 factorOf(const Shape& s) {
  return {s.axis0, s.axis0 * s.shear10, s.axis0 * s.shear20, 0, s.axis1, s.axis1 * s.shear21, 0, 0, s.axis2};
}

/// Another scalar in a piece that was cut from `from`, which has it.
inline SplatPiece withScalarOf(const SplatPiece& from, const SplatPiece& piece) {
  SplatPiece out = piece;
  out.mean = from.mean;
  out.slope = from.slope;
  if (piece.position == from.position && std::memcmp(&piece.shape, &from.shape, sizeof(Shape)) == 0)
    return out;
  const glm::dmat3 factor = factorOf(from.shape), inverse = glm::inverse(factor);
  const glm::dvec3 slope(from.slope.w0, from.slope.w1, from.slope.w2);
  const glm::dvec3 moved = inverse * glm::dvec3(piece.position - from.position);
  out.mean = static_cast<float>(from.mean + glm::dot(slope, moved));
  const glm::dvec3 along = glm::transpose(inverse * factorOf(piece.shape)) * slope;
  out.slope = {static_cast<float>(along.x), static_cast<float>(along.y), static_cast<float>(along.z)};
  return out;
}

/// Of a splat that is drawn as it is.
template <typename Map>
ScreenColour colourOf(const Map& map, const GeometryArrays<const float>& geometry,
                      const VariableArrays<const float>& colours, size_t i) {
  const Ellipse e = ellipseOf(rowsAt(map, geometry.x[i], geometry.y[i], geometry.z[i]), shapeOf(geometry, i),
                              slopeOf(colours, i), colours.variance[i], geometry.weight[i], map.low_pass);
  return {colours.mean[i], {e.slope0, e.slope1}, e.half_width, 0};
}

}  // namespace curvisplat
