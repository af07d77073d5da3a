#include "preprocess/moments/mesh_borders.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/geometric.hpp>

#include "preprocess/splats/merged_faces.h"

namespace curvisplat {
namespace {

constexpr double kSimilar = 0.7;  // cosine: of one plane
constexpr double kEven = 0.9;     // the length of a mean of unit vectors that are about the same
constexpr size_t kMaxDirections = 16;

/// The planes that touch, or do not, similar ones as one. A prism may have more sides than VoxelPlanes: then those that
/// are not closed, the largest first.
VoxelPlanes joined(std::span<const OuterPlane> planes, bool touching) {
  std::array<VoxelPlanes::Plane, kMaxDirections> places;
  size_t count = 0;
  for (const OuterPlane& plane : planes) {
    if (plane.touches != touching) continue;
    const double area = glm::length(plane.inward);
    VoxelPlanes::Plane* same = nullptr;
    for (size_t n = 0; n < count && !same; ++n) {
      const glm::dvec3& sum = places[n].inward;
      if (glm::dot(sum, plane.inward) > kSimilar * glm::length(sum) * area) same = &places[n];
    }
    if (!same) {
      if (count == kMaxDirections) continue;
      same = &places[count++];
      *same = {glm::dvec3(0.0), glm::dvec3(0.0), 0, 0, true};
    }
    same->inward += plane.inward;
    same->point += area * plane.point;
    same->area += area;
  }
  const std::span<VoxelPlanes::Plane> all = std::span(places).first(count);
  for (VoxelPlanes::Plane& plane : all) {
    const double length = glm::length(plane.inward);
    plane.face = length > kEven * plane.area;
    plane.inward /= length;
    plane.point /= plane.area;
  }
  std::array<VoxelPlanes::Plane, kMaxDirections> kept;
  auto end = count > VoxelPlanes::kMax
                 ? std::copy_if(all.begin(), all.end(), kept.begin(),
                                [&](const VoxelPlanes::Plane& plane) { return !isClosed(plane, all); })
                 : std::copy(all.begin(), all.end(), kept.begin());
  if (end - kept.begin() > static_cast<ptrdiff_t>(VoxelPlanes::kMax)) {
    std::stable_sort(kept.begin(), end, [](const auto& a, const auto& b) { return a.area > b.area; });
    end = kept.begin() + VoxelPlanes::kMax;
  }
  VoxelPlanes found;
  found.count =
      static_cast<size_t>(std::copy(kept.begin(), end, found.planes.begin()) - found.planes.begin());
  for (size_t n = 0; n < found.count && !touching; ++n) found.planes[n].area = 0;
  return found;
}

}  // namespace

uint32_t meshBorderCode(std::span<const OuterPlane> planes, const Splat& splat, double next) {
  if (!(splat.weight > 0)) return kNoBorder;
  const bool touching =
      std::any_of(planes.begin(), planes.end(), [](const OuterPlane& plane) { return plane.touches; });
  VoxelPlanes found = joined(planes, touching);
  for (size_t n = 0; n < found.count; ++n)
    found.planes[n].thickest = 0.5 * next * glm::length(found.planes[n].inward * splat.factor());
  return mergedBorderCode(found, splat.position, splat, 0);
}

}  // namespace curvisplat
