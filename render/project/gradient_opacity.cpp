#include "render/project/gradient_opacity.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

namespace curvisplat {
namespace {

constexpr uint64_t kMaxSampledSteps = 5;
constexpr size_t kMaxBricks = 128;  // of all steps

/// `count` numbers of 0 .. size - 1 at most, evenly spread.
std::vector<size_t> spread(size_t size, size_t count) {
  std::vector<size_t> chosen(std::min(size, count));
  for (size_t n = 0; n < chosen.size(); ++n)
    chosen[n] = chosen.size() > 1 ? n * (size - 1) / (chosen.size() - 1) : 0;
  return chosen;
}

}  // namespace

GradientPercentiles::GradientPercentiles(const CacheReader& cache, size_t variable, const glm::dvec3& scale) {
  const glm::vec3 per_scale(1.0 / scale);
  const std::vector<size_t> steps = spread(cache.series().steps.size(), kMaxSampledSteps);
  std::vector<float> magnitudes, volumes;
  SplatGeometry geometry;
  SplatVariable values;
  for (const size_t step : steps) {
    const CacheReader at_step = cache.atStep(step);
    std::vector<uint32_t> leaves;
    for (uint32_t n = 0; n < at_step.bricks().size(); ++n)
      if (at_step.bricks()[n].isLeaf()) leaves.push_back(n);
    for (const size_t n : spread(leaves.size(), kMaxBricks / steps.size())) {
      try {
        at_step.readGeometry(leaves[n], geometry);
        at_step.readVariable(leaves[n], variable, values);
      } catch (const DamagedBrick&) {
        continue;  // drawing it reports it
      }
      for (size_t i = 0; i < geometry.size(); ++i) {
        const Shape shape{geometry.axis0[i],   geometry.axis1[i],   geometry.axis2[i],
                          geometry.shear10[i], geometry.shear20[i], geometry.shear21[i]};
        const float magnitude =
            glm::length(gradientOf(shape, {values.slope0[i], values.slope1[i], values.slope2[i]}, per_scale));
        if (!std::isfinite(magnitude) || !(geometry.weight[i] > 0)) continue;
        magnitudes.push_back(magnitude);
        volumes.push_back(geometry.weight[i]);
      }
    }
  }
  set(magnitudes, volumes);
}

GradientPercentiles::GradientPercentiles(std::vector<float> magnitudes, const std::vector<float>& volumes) {
  set(magnitudes, volumes);
}

void GradientPercentiles::set(const std::vector<float>& magnitudes, const std::vector<float>& volumes) {
  magnitudes_.assign(kIntervals + 1, 0);
  if (magnitudes.empty()) return;
  std::vector<uint32_t> order(magnitudes.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return magnitudes[a] < magnitudes[b]; });
  const double volume = std::accumulate(volumes.begin(), volumes.end(), 0.0);
  double below = 0;
  size_t at = 0;
  for (size_t n = 0; n < kIntervals; ++n) {
    const double wanted = volume * static_cast<double>(n) / kIntervals;
    while (at + 1 < order.size() && below + volumes[order[at]] <= wanted) below += volumes[order[at++]];
    magnitudes_[n] = magnitudes[order[at]];
  }
  magnitudes_[kIntervals] = magnitudes[order.back()];
}

double GradientPercentiles::magnitudeAt(double share) const {
  const double at = share * kIntervals;
  const auto n = std::min(static_cast<size_t>(at), kIntervals - 1);
  return magnitudes_[n] + (at - static_cast<double>(n)) * (magnitudes_[n + 1] - magnitudes_[n]);
}

double GradientPercentiles::shareBelow(double magnitude) const {
  const auto found = std::lower_bound(magnitudes_.begin(), magnitudes_.end(), magnitude);
  if (found == magnitudes_.begin()) return 0;
  if (found == magnitudes_.end()) return 1;
  const double below = found[-1], part = (magnitude - below) / (*found - below);
  return (static_cast<double>(found - magnitudes_.begin()) - 1 + part) / kIntervals;
}

GradientOpacity::GradientOpacity(std::span<const OpacityPoint> points,
                                 const GradientPercentiles& percentiles) {
  const OpacityCurve curve(points);
  std::vector<double> shares;
  for (size_t n = 0; n <= GradientPercentiles::kIntervals; ++n)
    shares.push_back(static_cast<double>(n) / GradientPercentiles::kIntervals);
  for (const OpacityPoint& point : points) shares.push_back(point.x);
  std::sort(shares.begin(), shares.end());
  shares.erase(std::unique(shares.begin(), shares.end()), shares.end());
  for (const double share : shares) {
    magnitudes_.push_back(static_cast<float>(percentiles.magnitudeAt(share)));
    factors_.push_back(static_cast<float>(curve.at(share)));
    const auto jump = std::find_if(points.rbegin(), points.rend(),
                                   [&](const OpacityPoint& point) { return point.x == share; });
    if (jump == points.rend() || jump->opacity == curve.at(share)) continue;
    magnitudes_.push_back(magnitudes_.back());
    factors_.push_back(static_cast<float>(jump->opacity));
  }
}

float GradientOpacity::of(float magnitude) const {
  const auto found = std::lower_bound(magnitudes_.begin(), magnitudes_.end(), magnitude);
  if (found == magnitudes_.begin()) return factors_.front();
  if (found == magnitudes_.end()) return factors_.back();
  const auto n = static_cast<size_t>(found - magnitudes_.begin());
  const float part = (magnitude - magnitudes_[n - 1]) / (magnitudes_[n] - magnitudes_[n - 1]);
  return factors_[n - 1] + part * (factors_[n] - factors_[n - 1]);
}

}  // namespace curvisplat
