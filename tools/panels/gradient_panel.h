// The editor of the opacity by gradient (--gradient-opacity): two shares of the volume, over a histogram of the
// gradient's magnitude. For the window's thread, within a frame; the magnitudes are read on another one.
#pragma once

#include <future>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/colour/control_points.h"
#include "stream/cache/cache_reader.h"
#include "tools/view/gradient_histogram.h"

namespace curvisplat {

class GradientPanel {
 public:
  explicit GradientPanel(const CacheReader& cache) : cache_(cache) {}

  struct Result {
    bool changed = false;
    bool dragging = false;  // one of the shares is being dragged
    std::string error;      // of reading the magnitudes, once
  };
  /// Draws into the current Dear ImGui window. `points`: FrameOptions::gradient_opacity. `variable`: the scalar of the
  /// opacities. `scale`: stretches the data.
  Result draw(std::vector<OpacityPoint>& points, size_t variable, const glm::dvec3& scale);

 private:
  struct Magnitudes {
    GradientPercentiles percentiles;
    GradientHistogram histogram;
  };
  struct MagnitudesOf {
    size_t variable;
    glm::dvec3 scale;
    bool operator==(const MagnitudesOf&) const = default;
  };
  std::string updateMagnitudes(const MagnitudesOf& of);
  void drawHistogram(const std::vector<OpacityPoint>& points, size_t variable) const;

  const CacheReader& cache_;
  std::unique_ptr<const Magnitudes> magnitudes_;
  std::optional<MagnitudesOf> magnitudes_of_;  // shown or being read
  std::future<std::unique_ptr<const Magnitudes>> pending_;
};

}  // namespace curvisplat
