#include "preprocess/moments/mesh_borders.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "preprocess/splats/merged_faces.h"

namespace curvisplat {
namespace {

constexpr double kSimilar = 0.7;  // cosine: of one plane
constexpr double kEven = 0.9;     // the length of a mean of unit vectors that are about the same

/// The planes that touch, or do not, similar ones as one.
VoxelPlanes joined(std::span<const OuterPlane> planes, bool touching) {
  VoxelPlanes found;
  for (const OuterPlane& plane : planes) {
    if (plane.touches != touching) continue;
    const double area = glm::length(plane.inward);
    VoxelPlanes::Plane* same = nullptr;
    for (size_t n = 0; n < found.count && !same; ++n) {
      const glm::dvec3& sum = found.planes[n].inward;
      if (glm::dot(sum, plane.inward) > kSimilar * glm::length(sum) * area) same = &found.planes[n];
    }
    if (!same) {
      if (found.count == VoxelPlanes::kMost) continue;
      same = &found.planes[found.count++];
      *same = {glm::dvec3(0.0), glm::dvec3(0.0), 0, 0, true};
    }
    same->inward += plane.inward;
    same->point += area * plane.point;
    same->area += area;
  }
  for (size_t n = 0; n < found.count; ++n) {
    VoxelPlanes::Plane& plane = found.planes[n];
    const double length = glm::length(plane.inward);
    plane.face = length > kEven * plane.area;
    plane.inward /= length;
    plane.point /= plane.area;
    if (!touching) plane.area = 0;
  }
  return found;
}

}  // namespace

uint32_t meshBorderCode(std::span<const OuterPlane> planes, const Splat& splat, double next) {
  if (!(splat.weight > 0)) return kNoBorder;
  VoxelPlanes found = joined(planes, true);
  if (found.count == 0) found = joined(planes, false);
  for (size_t n = 0; n < found.count; ++n)
    found.planes[n].thickest = 0.5 * next * glm::length(found.planes[n].inward * splat.factor());
  return mergedBorderCode(found, splat.position, splat, 0);
}

}  // namespace curvisplat
