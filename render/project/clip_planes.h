// Half spaces outside of which nothing is drawn. A splat that a plane crosses is cut there, as at a border's
// face (face_cut.h), so that edges are crisp at every level of detail.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "render/project/splat_cutter.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// In data coordinates, before ScreenView::scale.
struct WorldBox {
  glm::dvec3 lower{0.0}, upper{0.0};
};

/// Points with normal · (x - point) >= 0 are drawn. Data coordinates; the normal may have any length but 0.
struct ClipPlane {
  glm::dvec3 point{0.0}, normal{0.0};
};

/// The most clip planes that a picture can have, in addition to the box.
inline constexpr size_t kMaxClipPlanes = 6;

/// Whether the plane has a direction: a normal of finite length above 0.
bool isUsable(const ClipPlane& plane);

/// The planes, and the six faces of the box if there is one, with normals that point inwards.
std::vector<ClipPlane> clipPlanesOf(std::span<const ClipPlane> planes, const std::optional<WorldBox>& box);

/// On which side of the clip planes a splat lies.
enum class ClipSide : uint8_t { kInside, kAcross, kOutside };

/// Clip planes in float, relative to a brick's origin.
class LocalClipPlanes {
 public:
  LocalClipPlanes(std::span<const ClipPlane> planes, const glm::dvec3& origin);

  bool empty() const { return planes_.empty(); }
  /// Writes the sides of splats begin .. begin + count - 1, with their whole support, to sides[0 .. count -
  /// 1].
  void sidesOf(const GeometryArrays<const float>& geometry, size_t begin, size_t count,
               std::span<ClipSide> sides) const;
  /// Whether a point is drawn.
  bool contains(const glm::vec3& point) const;
  /// Adds the planes that cross the piece to its faces. If there are more than CutFaces can hold, it keeps
  /// those that remove most of the piece.
  void addFaces(SplatPiece& piece) const;

 private:
  struct Plane {
    glm::vec3 normal;  // unit length
    float offset;      // the distance of x is normal · x + offset
  };
  std::vector<Plane> planes_;
};

}  // namespace curvisplat
