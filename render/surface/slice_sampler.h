// The scalar on a slice: a plane through the data, sampled at the pixels' centres.
//
// Of the splats near a point p, with w = V K(|A⁻¹(p - μ)|) / √det S, the scalar there is
//
//     f(p) = Σ w (f + slope · A⁻¹(p - μ)) / Σ w
//
// Coverage is the part of Σ w that lies on the inner side of borders' faces, smoothed over a pixel, and goes to 0
// where the sum itself does. Along a row of pixels A⁻¹(p - μ) is affine; in perspective it is the quotient of two
// affine functions, so the splat's pixels are found by a quadratic equation either way.
//
// Sums are in fixed point, so that they do not depend on the order of the splats. Any number of threads may add.
// Takes 24 bytes a pixel.
#pragma once

#include <atomic>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "render/project/clip_planes.h"
#include "render/project/screen_view.h"
#include "render/project/splat_cutter.h"
#include "stream/base/ranks.h"
#include "stream/model/border_code.h"
#include "stream/model/brick.h"

namespace curvisplat {

class SliceSampler {
 public:
  /// `low`, `high`: the scalar's range. `borders`: how cells at borders are drawn.
  SliceSampler(const ScreenView& view, const ClipPlane& plane, double low, double high,
               const BorderStyle& borders);

  const ClipPlane& plane() const { return plane_; }
  /// Whether the plane is seen from a side: if not, no pixel has a point of it.
  bool isSeen() const { return seen_; }
  /// Adds the splats of a brick that `ranges` hold.
  void add(const glm::dvec3& cell_min, const GeometryArrays<const float>& geometry,
           const VariableArrays<const float>& variable, std::span<const SplatRange> ranges);

  /// Adds what the samplers of all other ranks have, which sampled other bricks. All have to call it.
  void addOthers(Ranks& ranks);

  struct Sample {
    double scalar;
    float coverage;  // above 0
    float depth;     // PixelLayers', from the depth origin
    glm::dvec3 at;   // data coordinates
  };
  /// After the last add(). `depth_origin` as in PixelLayers.
  std::optional<Sample> at(int x, int y, double depth_origin) const;
  /// Whether any pixel has a sample.
  bool isEmpty() const { return !touched_.load(std::memory_order_relaxed); }

 private:
  /// The ray of a pixel meets the plane at base + t direction, in data coordinates; 1/t is affine.
  struct Hit {
    glm::dvec3 direction;
    double inverse;  // 1/t
  };
  Hit hitOf(double x, double y) const;
  void addPiece(const glm::dvec3& cell_min, const SplatPiece& piece);

  const ScreenView view_;
  const ClipPlane plane_;
  const double low_, per_range_;
  const BorderStyle borders_;
  bool seen_ = false;
  struct Sums {
    int64_t weight = 0, scalar = 0, outside = 0;
  };
  std::vector<Sums> sums_;  // [pixels]
  std::atomic<bool> touched_ = false;
};

}  // namespace curvisplat
