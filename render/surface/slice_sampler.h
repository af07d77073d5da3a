// The scalar on a slice: a plane through the data, sampled at the pixels' centres.
//
// The splats near a point p give it a scalar. With w = V K(|A⁻¹(p - μ)|) / √det S, d = p - μ and the gradient
// g = A⁻ᵀ slope, it is
//
//     f(p) = Σ w (f + d · (0.9 g + 0.1 G)) / Σ w        G = Σ w g / Σ w
//
// which is exact where f is linear. With g alone it is off by the scalar's second derivative times the kernel's variance,
// less what means over cells are off the other way; a tenth of the gradient of all makes up for that.
//
// Coverage is the part of Σ w that lies on the inner side of borders' faces, smoothed over a pixel, and goes to 0
// where the sum itself does. Along a row of pixels A⁻¹(p - μ) is affine; in perspective it is the quotient of two
// affine functions, so the splat's pixels are found by a quadratic equation either way.
//
// Sums are in fixed point, so that they do not depend on the order of the splats. Any number of threads may add.
// Takes 72 bytes a pixel.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "render/project/plane_cuts.h"
#include "render/project/screen_view.h"
#include "render/project/splat_pieces.h"
#include "stream/base/ranks.h"
#include "stream/model/border_code.h"
#include "stream/model/octree.h"

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
  /// The sample at a pixel, after the last add(). `depth_origin` as in PixelLayers.
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
  const double per_length_;  // about a pixel's side at the slice: the unit of what is moved
  const BorderStyle borders_;
  const double own_, common_;  // how much of each gradient counts
  bool seen_ = false;
  struct Sums {
    int64_t weight = 0, outside = 0;
    int64_t scalar = 0;  // of w (f + 0.9 d · g)
    std::array<int64_t, 3> moved{}, gradient{};
  };
  std::vector<Sums> sums_;  // [pixels]
  std::atomic<bool> touched_ = false;
};

}  // namespace curvisplat
