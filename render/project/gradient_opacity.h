// Opacity by how steep the scalar is: a factor of each splat's extinction, over percentiles of the gradient's
// magnitude. DESIGN.md, "Gradient opacity".
//
// A splat's slope is the same all over it, and so is the factor: what is exact for the pixels of a splat stays
// so. GradientPercentiles reads some of the cache's finest bricks, at most 128 (0.1 s), the same in every run.
// Immutable; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <span>
#include <vector>

#include "render/colour/control_points.h"
#include "render/project/footprint.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The gradient of the scalar of a splat, over stretched space: Aᵀ g = w, divided by the scale factors.
inline glm::vec3 gradientOf(const Shape& s, const Slope& w, const glm::vec3& per_scale) {
  const float gz = w.w2 / s.axis2, gy = w.w1 / s.axis1 - s.shear21 * gz;  // from the last row up
  return glm::vec3(w.w0 / s.axis0 - s.shear10 * gy - s.shear20 * gz, gy, gz) * per_scale;
}

/// How steep a scalar is over the volume of the data.
class GradientPercentiles {
 public:
  static constexpr size_t kIntervals = 256;

  /// Measures the finest splats, at up to five steps of a series. Damaged bricks are left out; throws Error
  /// if the disk fails. `scale`: stretches the data.
  GradientPercentiles(const CacheReader& cache, size_t variable, const glm::dvec3& scale);
  /// Measures `magnitudes`, each with its volume; of these some are above zero.
  GradientPercentiles(std::vector<float> magnitudes, const std::vector<float>& volumes);

  /// [kIntervals + 1]: n / kIntervals of the volume is less steep. All 0 without data.
  std::span<const float> magnitudes() const { return magnitudes_; }
  /// The magnitude that the share `share` (0 to 1) of the volume is less steep than.
  double magnitudeAt(double share) const;
  /// The share of the volume that is less steep; the lowest where percentiles are equal.
  double shareBelow(double magnitude) const;

 private:
  void set(const std::vector<float>& magnitudes, const std::vector<float>& volumes);

  std::vector<float> magnitudes_;
};

/// The factor of a splat's extinction: piecewise linear in the magnitude, between those of the percentiles
/// and of the points. Where percentiles have equal magnitudes, the lowest counts: the share of the volume
/// that is less steep.
class GradientOpacity {
 public:
  /// `points`: x from 0 to 1, the share of the volume that is less steep; opacities from 0 to 1.
  GradientOpacity(std::span<const OpacityPoint> points, const GradientPercentiles& percentiles);

  float of(float magnitude) const;
  /// The ends of the linear pieces, and the factors there.
  std::span<const float> magnitudes() const { return magnitudes_; }
  std::span<const float> factors() const { return factors_; }

 private:
  std::vector<float> magnitudes_, factors_;
};

}  // namespace curvisplat
