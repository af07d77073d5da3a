#include "render/project/brick_store.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <numbers>

namespace curvisplat {

bool BrickStore::canDraw(const ProjectionSettings& settings) {
  return !settings.layers && !settings.gradient;
}

bool BrickStore::canDraw(const Brick& brick, const glm::dvec3& cell_min, const ProjectionSettings& settings) {
  const glm::dvec3 middle = 0.5 * (brick.lower + brick.upper), extent = 0.5 * (brick.upper - brick.lower);
  const auto is_inside = [&](const ClipPlane& plane) {
    const glm::dvec3 normal = glm::normalize(plane.normal);
    return glm::dot(normal, middle - plane.point) - glm::dot(glm::abs(normal), extent) >
           1.01 * brick.largest_radius;  // but for rounding
  };
  if (!std::all_of(settings.clip_planes.begin(), settings.clip_planes.end(), is_inside)) return false;
  const ScreenView& view = settings.view;
  if (view.projection == Projection::kOrthographic) return true;
  const double radius = brick.largest_radius * std::max({view.scale.x, view.scale.y, view.scale.z});
  const double half = glm::dot(glm::abs(view.forward * view.scale), extent);
  const double nearest = view.viewFromData(middle).z - half;
  // PerspectiveMap::radiusOf() may be √3 times as large; one in a hundred is for rounding.
  return nearest > view.near && view.viewFromData(cell_min).z > view.near &&
         std::numbers::sqrt3 * radius <= 0.99 * view.widest * nearest;
}

}  // namespace curvisplat
