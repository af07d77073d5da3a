#include "render/project/splat_maps.h"

namespace curvisplat {

OrthographicMap::OrthographicMap(const ScreenView& view, const glm::dvec3& origin) {
  const glm::dvec2 at = view.pixelFromView(view.viewFromData(origin));
  const glm::dvec3 across = view.focal_px * view.right * view.scale,
                   along = view.focal_px * view.down * view.scale;
  x = static_cast<float>(at.x);
  y = static_cast<float>(at.y);
  rows = {static_cast<float>(across.x), static_cast<float>(across.y), static_cast<float>(across.z),
          static_cast<float>(along.x),  static_cast<float>(along.y),  static_cast<float>(along.z)};
  depth = glm::vec3(view.forward * view.scale);
  volume = static_cast<float>(view.focal_px * view.focal_px * view.scale.x * view.scale.y * view.scale.z);
  low_pass = {static_cast<float>(view.low_pass_px2), static_cast<float>(view.slope_low_pass_px2)};
}

PerspectiveMap::PerspectiveMap(const ScreenView& view, const glm::dvec3& origin_, float coarseness)
    : origin(view.viewFromData(origin_)),
      right(view.right * view.scale),
      down(view.down * view.scale),
      forward(view.forward * view.scale),
      scale(view.scale),
      middle_x(0.5f * static_cast<float>(view.size.width)),
      middle_y(0.5f * static_cast<float>(view.size.height)),
      focal_px(static_cast<float>(view.focal_px)),
      volume(static_cast<float>(view.scale.x * view.scale.y * view.scale.z)),
      near(static_cast<float>(view.near) * coarseness),
      widest(static_cast<float>(view.widest) * coarseness),
      low_pass{static_cast<float>(view.low_pass_px2), static_cast<float>(view.slope_low_pass_px2)} {
  const auto reach = static_cast<float>(kKernelSupport) * std::sqrt(low_pass.footprint_px2);
  tangent_x = (middle_x + reach) / focal_px;
  tangent_y = (middle_y + reach) / focal_px;
  slant_x = std::sqrt(1 + tangent_x * tangent_x);
  slant_y = std::sqrt(1 + tangent_y * tangent_y);
}

}  // namespace curvisplat
