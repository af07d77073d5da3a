// Where a brick's splats lie among the layers of a picture: in front of all that their pixels have, behind opaque
// ones, or somewhere where they have to be cut. Any thread.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "render/project/face_cut.h"
#include "render/project/pixel_layers.h"
#include "render/project/screen_view.h"
#include "render/project/splat_ellipse.h"

namespace curvisplat {

enum class LayerSide : uint8_t { kBefore, kAcross, kBehind };

class LocalLayers {
 public:
  /// `layers`: null where there are none. Depths are counted from `origin` where the view is orthographic.
  LocalLayers(const PixelLayers* layers, const ScreenView& view, const glm::dvec3& origin) : layers_(layers) {
    if (layers && view.projection == Projection::kOrthographic)
      offset_ = static_cast<float>(view.viewFromData(origin).z - layers->depthOrigin());
  }

  bool empty() const { return !layers_; }
  /// A projected splat's depth, as layers have it.
  float depthOf(float depth) const { return depth + offset_; }

  LayerSide sideOf(float x, float y, const Ellipse& e, float depth, const glm::vec3& depth_row,
                   const Shape& s) const {
    constexpr auto kSupport = static_cast<float>(kKernelSupport);
    const glm::vec3 q(s.axis0 * (depth_row.x + depth_row.y * s.shear10 + depth_row.z * s.shear20),
                      s.axis1 * (depth_row.y + depth_row.z * s.shear21), s.axis2 * depth_row.z);
    const float reach = kDepthReach * glm::length(q);
    const float reach_x = kSupport * e.l11, reach_y = kSupport * (std::abs(e.l21) + e.l22);
    const PixelLayers::Bounds bounds =
        layers_->boundsOver({x - reach_x, y - reach_y, x + reach_x, y + reach_y});
    const float at = depthOf(depth);
    if (at + reach <= bounds.nearest) return LayerSide::kBefore;
    return at - reach >= bounds.hidden ? LayerSide::kBehind : LayerSide::kAcross;
  }

 private:
  const PixelLayers* layers_;
  float offset_ = 0;
};

}  // namespace curvisplat
