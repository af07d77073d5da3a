// Coarse samples as seen from one side, sorted into square pixels: what a silhouette is measured with.
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <string_view>
#include <vector>

#include "render/automatic/coarse_samples.h"
#include "render/camera/camera.h"

namespace curvisplat {

/// Immutable; any thread.
class PixelSums {
 public:
  /// Of the longer side: some 50 samples for each pixel.
  static constexpr int kPixels = 80;

  /// `view`: as Camera::named() knows it. Requires one sample or more.
  PixelSums(const CoarseSamples& samples, std::string_view view) {
    glm::dvec3 lower(std::numeric_limits<double>::max()), upper(-std::numeric_limits<double>::max());
    for (const glm::dvec3& position : samples.positions) {
      lower = glm::min(lower, position);
      upper = glm::max(upper, position);
    }
    const Camera camera = Camera::named(view, lower, upper, {kPixels, kPixels}, Projection::kOrthographic);
    const glm::dmat4 view_from_world = camera.viewFromWorld();
    glm::dvec2 lowest(std::numeric_limits<double>::max()), highest(-std::numeric_limits<double>::max());
    places_.reserve(samples.size());
    for (const glm::dvec3& position : samples.positions) {
      places_.emplace_back(view_from_world * glm::dvec4(position, 1));
      lowest = glm::min(lowest, places_.back());
      highest = glm::max(highest, places_.back());
    }
    lowest_ = lowest;
    width_ = std::max(highest.x - lowest.x, highest.y - lowest.y) / kPixels;
  }

  /// [pixel]: the sum of weightOf(n) over its samples n. All are 0 if the samples are one point.
  template <typename WeightOf>
  std::vector<double> of(const WeightOf& weightOf) const {
    std::vector<double> sums(size_t{kPixels} * kPixels, 0);
    if (!(width_ > 0)) return sums;
    for (size_t n = 0; n < places_.size(); ++n) {
      const glm::dvec2 place = (places_[n] - lowest_) / width_;
      const auto column = static_cast<size_t>(std::min(kPixels - 1, static_cast<int>(place.x)));
      const auto row = static_cast<size_t>(std::min(kPixels - 1, static_cast<int>(place.y)));
      sums[row * kPixels + column] += weightOf(n);
    }
    return sums;
  }
  /// The area of the pixels whose sum is over `least`, world units squared.
  double areaOver(double least, const std::vector<double>& sums) const {
    return width_ * width_ * static_cast<double>(std::count_if(sums.begin(), sums.end(), [&](double sum) {
             return sum > least;
           }));
  }
  /// Of the pixels with samples.
  double coveredArea() const {
    return areaOver(0, of([](size_t) { return 1.0; }));
  }
  double pixelArea() const { return width_ * width_; }

 private:
  std::vector<glm::dvec2> places_;  // [sample]
  glm::dvec2 lowest_{0};
  double width_ = 0;
};

}  // namespace curvisplat
