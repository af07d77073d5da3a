// A camera and an image, prepared for projecting bricks: all constants of one view that are the same for
// every splat. Double precision.
//
// "Stretched" space is the data's after --scale: what the camera looks at. Pixels count from the left and
// from the top; pixel (0, 0) covers [0, 1) x [0, 1).
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render/camera/camera.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// Added to S2, pixels squared. A footprint reaches 0.85 pixels at the least: no splat falls between pixels,
/// and one that is larger than a pixel stays as crisp as it is. (1.5, a Gaussian over the pixel, blurs what
/// rays through the pixels' centres would see: 2 to 10 dB less.)
inline constexpr double kLowPass = 0.3;

/// Added to S2 where the slope is projected, pixels squared: keeps it invertible, and no more. The slope is
/// the field's, not the pixel's.
inline constexpr double kSlopeLowPass = 0.01;

/// Perspective: radius of a splat's support over its distance, from which on it is cut. The map of a smaller
/// one is off by at most 2 % of the splat's size at one deviation from the centre.
inline constexpr double kWidest = 0.4;

/// Bounds of the factors by which data are scaled.
inline constexpr double kMinScale = 1e-6, kMaxScale = 1e6;

/// A view as the projection uses it. "Stretched" space is scale * data.
struct ScreenView {
  Projection projection = Projection::kOrthographic;
  ImageSize size;
  glm::dvec3 eye{0.0};  // stretched; orthographic: the camera's position
  glm::dvec3 right{1, 0, 0}, down{0, -1, 0}, forward{0, 0, -1};  // stretched, orthonormal
  double focal_px = 1;    // orthographic: pixels to a stretched unit; perspective: pixels to a tangent of 1
  double near = 1e-3;     // perspective: nothing nearer along `forward` is drawn. Stretched units
  glm::dvec3 scale{1.0};  // stretched = scale * data
  double low_pass_px2 = kLowPass;
  double slope_low_pass_px2 = kSlopeLowPass;  // other values than these are for tests
  double widest = kWidest;

  /// Throws UsageError for invalid numbers: an image without pixels, a scale or extent that is not positive,
  /// an angle outside (0, 180) degrees.
  static ScreenView of(const Camera& camera, ImageSize size, const glm::dvec3& scale, double low_pass_px2,
                       double near);

  /// A point of the data in view axes (right, down, forward), stretched units, from the eye.
  glm::dvec3 viewFromData(const glm::dvec3& data) const;
  /// The same view as the cut needs it, with the image's edges moved out by the reach of the low-pass.
  CutView cutView() const;

  /// Perspective: a depth along the view from which the splats of the brick with this corner are ordered.
  double orderBase(const glm::dvec3& corner) const {
    return std::max(std::abs(viewFromData(corner).z), near);
  }

  /// The place in the image of a point in view axes, which in perspective must be in front of the eye.
  glm::dvec2 pixelFromView(const glm::dvec3& view) const;
};

}  // namespace curvisplat
