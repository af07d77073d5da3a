// The constants of one view's projection for one brick, in float and relative to the brick's origin.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>

#include "render/project/screen_view.h"
#include "render/project/splat_ellipse.h"

namespace curvisplat {

/// One linear map for all splats of a brick.
struct OrthographicMap {
  float x, y;       // the origin, pixels
  ScreenRows rows;  // pixels to a unit of the data
  glm::vec3 depth;  // stretched units along the view
  float volume;     // pixels² and stretched depth to a unit cubed of the data
  LowPass low_pass;

  OrthographicMap(const ScreenView& view, const glm::dvec3& origin);

  /// Depth per unit of the data.
  glm::vec3 depthRow(float, float, float) const { return depth; }
};

/// The local affine map of each splat (Zwicker et al., "EWA Volume Splatting", 2001), with the distance from
/// the eye as depth: det M = focal² |c| / z³ at c in view axes.
struct PerspectiveMap {
  struct Centre {
    float x, y, z;   // view axes: right, down, forward; stretched units
    float distance;  // from the eye
  };

  glm::vec3 origin;                // in view axes
  glm::vec3 right, down, forward;  // stretched view axes to a unit of the data
  glm::vec3 scale;
  float middle_x, middle_y, focal_px;
  float volume;  // the stretch's
  float near, widest;
  LowPass low_pass;
  float tangent_x, tangent_y;  // of the image's edges, the low-pass' reach added
  float slant_x, slant_y;      // √(1 + tangent²)

  /// `coarseness` multiplies the near plane's distance and the view's `widest`.
  PerspectiveMap(const ScreenView& view, const glm::dvec3& origin, float coarseness);

  Centre centreOf(float x_, float y_, float z_) const {
    const float x = origin.x + right.x * x_ + right.y * y_ + right.z * z_;
    const float y = origin.y + down.x * x_ + down.y * y_ + down.z * z_;
    const float z = origin.z + forward.x * x_ + forward.y * y_ + forward.z * z_;
    return {x, y, z, std::sqrt(x * x + y * y + z * z)};
  }

  float pixelX(const Centre& c) const { return middle_x + focal_px * c.x / c.z; }
  float pixelY(const Centre& c) const { return middle_y + focal_px * c.y / c.z; }

  ScreenRows rowsAt(const Centre& c) const {
    const float pixels = focal_px / c.z, x = c.x / c.z, y = c.y / c.z;
    return {pixels * (right.x - x * forward.x), pixels * (right.y - x * forward.y),
            pixels * (right.z - x * forward.z), pixels * (down.x - y * forward.x),
            pixels * (down.y - y * forward.y),  pixels * (down.z - y * forward.z)};
  }

  /// Depth, the distance from the eye, per unit of the data.
  glm::vec3 depthRowAt(const Centre& c) const {
    return (c.x * right + c.y * down + c.z * forward) / std::max(c.distance, 1e-30f);
  }
  glm::vec3 depthRow(float x, float y, float z) const { return depthRowAt(centreOf(x, y, z)); }

  float volumeAt(const Centre& c) const {
    return volume * focal_px * focal_px * c.distance / (c.z * c.z * c.z);
  }

  /// Squared lengths of A's columns, stretched.
  glm::vec3 columns2(const Shape& s) const {
    const float x2 = scale.x * scale.x, y2 = scale.y * scale.y, z2 = scale.z * scale.z;
    return {s.axis0 * s.axis0 * (x2 + y2 * s.shear10 * s.shear10 + z2 * s.shear20 * s.shear20),
            s.axis1 * s.axis1 * (y2 + z2 * s.shear21 * s.shear21), s.axis2 * s.axis2 * z2};
  }
  /// No part of the splat's support is farther from its centre. Stretched units.
  float radiusOf(const Shape& shape) const {
    const glm::vec3 c = columns2(shape);
    return static_cast<float>(kKernelSupport) * std::sqrt(c.x + c.y + c.z);
  }
  bool tooWide(const Centre& c, float radius) const { return !(c.z >= near) | !(radius <= widest * c.z); }
  /// No part of a ball around the centre can show.
  bool outOfSight(const Centre& c, float radius) const {
    return c.z + radius <= near || std::abs(c.x) - tangent_x * c.z > radius * slant_x ||
           std::abs(c.y) - tangent_y * c.z > radius * slant_y;
  }
};

}  // namespace curvisplat
