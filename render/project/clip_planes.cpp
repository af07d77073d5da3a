#include "render/project/clip_planes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "render/project/kernel.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

constexpr auto kSupport = static_cast<float>(kKernelSupport);
constexpr auto kSupportAtBorder = static_cast<float>(kKernelSupport + kMergedReach);  // as it is drawn

/// Aᵀ n: its length is how far the unit sphere's image reaches along n.
glm::vec3 inFrame(const Shape& s, const glm::vec3& n) {
  return {s.axis0 * (n.x + s.shear10 * n.y + s.shear20 * n.z), s.axis1 * (n.y + s.shear21 * n.z),
          s.axis2 * n.z};
}

}  // namespace

bool isUsable(const ClipPlane& plane) {
  const double length = glm::length(plane.normal);
  return length > 1e-100 && std::isfinite(length);
}

std::vector<ClipPlane> clipPlanesOf(std::span<const ClipPlane> planes, const std::optional<WorldBox>& box) {
  std::vector<ClipPlane> all(planes.begin(), planes.end());
  if (!box) return all;
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 normal(0.0);
    normal[axis] = 1;
    all.push_back({box->lower, normal});
    all.push_back({box->upper, -normal});
  }
  return all;
}

LocalClipPlanes::LocalClipPlanes(std::span<const ClipPlane> planes, const glm::dvec3& origin) {
  for (const ClipPlane& plane : planes) {
    const glm::dvec3 normal = glm::normalize(plane.normal);
    planes_.push_back({glm::vec3(normal), static_cast<float>(glm::dot(normal, origin - plane.point))});
  }
}

void LocalClipPlanes::sidesOf(const GeometryArrays<const float>& geometry, size_t begin, size_t count,
                              std::span<ClipSide> sides) const {
  std::fill_n(sides.begin(), count, ClipSide::kInside);
  for (const Plane& plane : planes_) {
    const glm::vec3 n = plane.normal;
    for (size_t i = 0; i < count; ++i) {
      const Shape shape = shapeOf(geometry, begin + i);
      const glm::vec3 q = inFrame(shape, n);
      const float distance = n.x * geometry.x[begin + i] + n.y * geometry.y[begin + i] +
                             n.z * geometry.z[begin + i] + plane.offset;
      const float support = geometry.border_code[begin + i] == kNoBorder ? kSupport : kSupportAtBorder;
      const float reach = support * std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
      const ClipSide side = distance >= reach   ? ClipSide::kInside
                            : distance > -reach ? ClipSide::kAcross
                                                : ClipSide::kOutside;
      sides[i] = std::max(sides[i], side);
    }
  }
}

bool LocalClipPlanes::contains(const glm::vec3& point) const {
  return std::all_of(planes_.begin(), planes_.end(),
                     [&](const Plane& plane) { return glm::dot(plane.normal, point) + plane.offset >= 0; });
}

void LocalClipPlanes::addFaces(SplatPiece& piece) const {
  for (const Plane& plane : planes_) {
    const glm::vec3 q = inFrame(piece.shape, plane.normal);
    const float length = glm::length(q);
    if (!(length > 0)) continue;
    const float distance = (glm::dot(plane.normal, piece.position) + plane.offset) / length;
    if (distance < kSupport) piece.faces.add({q / length, distance});
  }
}

}  // namespace curvisplat
