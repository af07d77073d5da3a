#include "render/project/brick_store.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>

namespace curvisplat {

bool BrickStore::canDraw(const ProjectionSettings& settings) {
  return settings.clip_planes.empty() && !settings.layers && !settings.gradient;
}

bool BrickStore::canDraw(const Brick& brick, const ScreenView& view) {
  if (view.projection == Projection::kOrthographic) return true;
  const double radius = brick.largest_radius * std::max({view.scale.x, view.scale.y, view.scale.z});
  const double half = 0.5 * glm::dot(glm::abs(view.forward * view.scale), brick.upper - brick.lower);
  const double nearest = view.viewFromData(0.5 * (brick.lower + brick.upper)).z - half;
  return nearest > view.near && radius <= 0.99 * view.widest * nearest;  // but for rounding
}

}  // namespace curvisplat
