#include "render/project/brick_store.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <numbers>
#include <optional>

#include "render/project/splat_pieces.h"
#include "stream/base/error.h"
#include "stream/model/border_code.h"

namespace curvisplat {

namespace {

StoredPiece storedPiece(const SplatPiece& piece) {
  const Shape& s = piece.shape;
  CURVISPLAT_CHECK_OP(static_cast<size_t>(piece.faces.count), <=, StoredPiece::kMaxFaces);
  StoredPiece out{};
  out.x = piece.position.x;
  out.y = piece.position.y;
  out.z = piece.position.z;
  out.axis0 = s.axis0;
  out.axis1 = s.axis1;
  out.axis2 = s.axis2;
  out.weight = piece.weight;
  out.shear10 = s.shear10;
  out.shear20 = s.shear20;
  out.shear21 = s.shear21;
  out.counts = static_cast<uint32_t>(piece.faces.count) | static_cast<uint32_t>(piece.growth.count) << 16;
  for (size_t n = 0; n < static_cast<size_t>(piece.faces.count); ++n) {
    const CutFace& face = piece.faces.face[n];
    out.faces[n] = {face.inward.x, face.inward.y, face.inward.z, face.distance};
    if (face.edge_on) out.counts |= 1u << (8 + n);
  }
  if (piece.across != glm::vec3(0.0f)) {
    out.counts |= 1u << 24;
    out.faces[0] = {piece.across.x, piece.across.y, piece.across.z, 0};
  }
  for (size_t n = 0; n < piece.growth.count; ++n) {
    const glm::vec3& along = piece.growth.along[n];
    out.growth[n] = {along.x, along.y, along.z, piece.growth.growth[n]};
  }
  return out;
}

/// Nothing if there are more than BrickProjector draws.
std::optional<BrickPieces> dividedBy(const BorderStyle& borders, const GeometryArrays<const float>& geometry,
                                     const VariableArrays<const float>& values) {
  BrickPieces out;
  BorderPieces parts;
  size_t further = 0;  // records that BrickProjector::kMaxPieces limits
  for (uint32_t i = 0; i < geometry.size(); ++i) {
    const uint32_t code = geometry.border_code[i];
    if (code == kNoBorder) continue;
    const InwardAxes inward = inwardAxes(code);
    const SplatPiece whole = wholeOf(geometry, values, i);
    const size_t count = partsAtBorder(whole, inward, layersOf(code), borders, parts);
    const glm::dvec3 slope(whole.slope.w0, whole.slope.w1, whole.slope.w2);
    out.splats.push_back({i, static_cast<uint32_t>(out.pieces.size()), static_cast<uint32_t>(count)});
    out.drawn_slopes.push_back(static_cast<float>(drawnSlope(slope, inward)));
    for (size_t n = 0; n < count; ++n) {
      const SplatPiece& piece = parts[n];
      out.pieces.push_back(storedPiece(piece));
      out.values.push_back({piece.mean, piece.slope.w0, piece.slope.w1, piece.slope.w2});
    }
    const bool has_faces = inward.faces != 0 || layersOf(code) != 0;
    further += has_faces ? 2 * count - 1 : count;  // as choosePieces() in projection.cpp counts them
    if (further > BrickProjector::kMaxPieces) return {};
  }
  return out;
}

}  // namespace

BrickPieces BrickPieces::of(const GeometryArrays<const float>& geometry,
                            const VariableArrays<const float>& values, const BorderStyle& borders) {
  if (auto divided = dividedBy(borders, geometry, values)) return *std::move(divided);
  if (isOfPairs(borders))
    if (auto divided = dividedBy(kWholeCellStyle, geometry, values)) return *std::move(divided);
  return {{}, {}, {}, {}, true};
}

uint32_t BrickStore::clipsOf(const Brick& brick, const ProjectionSettings& settings) {
  const glm::dvec3 middle = 0.5 * (brick.lower + brick.upper), extent = 0.5 * (brick.upper - brick.lower);
  uint32_t clips = 0;
  for (size_t n = 0; n < settings.clip_planes.size(); ++n) {
    const ClipPlane& plane = settings.clip_planes[n];
    const glm::dvec3 normal = glm::normalize(plane.normal);
    const bool is_inside = glm::dot(normal, middle - plane.point) - glm::dot(glm::abs(normal), extent) >
                           1.01 * brick.largest_radius;  // but for rounding
    if (!is_inside) clips |= 1u << n;
  }
  return clips;
}

bool BrickStore::canDraw(const Brick& brick, const glm::dvec3& cell_min, const ScreenView& view) {
  const glm::dvec3 middle = 0.5 * (brick.lower + brick.upper), extent = 0.5 * (brick.upper - brick.lower);
  if (view.projection == Projection::kOrthographic) return true;
  constexpr double kOfPieces = 1.25;  // pieces at edges may be larger than their splats
  const double radius =
      kOfPieces * brick.largest_radius * std::max({view.scale.x, view.scale.y, view.scale.z});
  const double half = glm::dot(glm::abs(view.forward * view.scale), extent);
  const double nearest = view.viewFromData(middle).z - half;
  // PerspectiveMap::radiusOf() may be √3 times as large; one in a hundred is for rounding.
  return nearest > view.near && view.viewFromData(cell_min).z > view.near &&
         std::numbers::sqrt3 * radius <= 0.99 * view.widest * nearest;
}

}  // namespace curvisplat
