#include "render/automatic/coarse_samples.h"

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

namespace curvisplat {
namespace {

constexpr uint64_t kMinSplats = 50'000;
// Small grids have a few points for each splat, since more tell little that is new, but no fewer than kMinSamples in all.
constexpr size_t kMinSamples = 60'000, kMaxSamples = 300'000, kSamplesPerSplat = 4;
constexpr uint64_t kMaxSteps = 5;

/// A point of the unit cube, of a sequence that fills it evenly (Kronecker's, with powers of the root of
/// x^5 = x + 1): the same in every run.
class CubePoints {
 public:
  /// x, y, z and a fourth, independent coordinate; each in [-0.5, 0.5).
  std::array<double, 4> next() {
    std::array<double, 4> point;
    for (size_t axis = 0; axis < 4; ++axis) {
      at_[axis] += kSteps[axis];
      if (at_[axis] >= 1) at_[axis] -= 1;
      point[axis] = at_[axis] - 0.5;
    }
    return point;
  }

 private:
  static constexpr std::array<double, 4> kSteps{0.8566748838545029, 0.7338918566271260, 0.6287067210378087,
                                                0.5385972572236101};
  std::array<double, 4> at_{};
};

/// The settings that the points of several steps have in common.
struct Sampling {
  size_t variable;
  glm::dvec3 scale;
  float min, max;        // of the values
  size_t points;         // of a splat
  double volume_factor;  // of a splat's volume, for one of its points
};

/// Adds the points of these bricks at the reader's step.
void addSamples(const CacheReader& cache, std::span<const uint32_t> bricks, const Sampling& of,
                CubePoints& places, CoarseSamples& samples) {
  const Manifest& manifest = cache.manifest();
  SplatGeometry geometry;
  SplatVariable values;
  for (const uint32_t brick : bricks) {
    try {
      cache.readGeometry(brick, geometry);
      cache.readVariable(brick, of.variable, values);
    } catch (const DamagedBrick&) {
      continue;  // drawing it reports it
    }
    const glm::dvec3 corner = manifest.root.cellMin(cache.bricks()[brick].cell);
    for (size_t n = 0; n < values.size(); ++n) {
      const double a0 = geometry.axis0[n], a1 = geometry.axis1[n], a2 = geometry.axis2[n];
      const double l10 = geometry.shear10[n], l20 = geometry.shear20[n], l21 = geometry.shear21[n];
      const double deviation = std::sqrt(12 * std::max(0.0, static_cast<double>(values.variance[n])));
      const double volume = of.volume_factor * geometry.weight[n];
      for (size_t point = 0; point < of.points; ++point) {
        const auto [u, v, w, t] = places.next();
        const glm::dvec3 offset(a0 * u, a0 * l10 * u + a1 * v, a0 * l20 * u + a1 * l21 * v + a2 * w);
        const double value = values.mean[n] + values.slope0[n] * u + values.slope1[n] * v +
                             values.slope2[n] * w + deviation * t;
        samples.positions.push_back(
            of.scale * (corner + glm::dvec3(geometry.x[n], geometry.y[n], geometry.z[n]) + offset));
        samples.values.push_back(std::clamp(static_cast<float>(value), of.min, of.max));
        samples.volumes.push_back(volume);
        samples.volume += volume;
      }
    }
  }
}

/// How many points stand for each of `splats` splats.
size_t pointsPerSplat(size_t splats) {
  if (splats == 0) return 1;
  const auto reaching = [&](size_t points) { return (points + splats - 1) / splats; };
  return std::min(reaching(kMaxSamples), std::max(kSamplesPerSplat, reaching(kMinSamples)));
}

}  // namespace

VariableInfo variableFor(const CacheReader& cache, size_t variable, ChosenFor what) {
  const Manifest& manifest = what == ChosenFor::kSeries ? cache.seriesManifest() : cache.manifest();
  return manifest.variables[variable];
}

CoarseSamples coarseSamples(const CacheReader& cache, size_t variable, const glm::dvec3& scale,
                            ChosenFor what) {
  const uint64_t of_series = cache.series().steps.size();
  const uint64_t steps = what == ChosenFor::kSeries ? std::min(of_series, kMaxSteps) : 1;
  const std::vector<uint32_t> chosen = bricksAtALevel(cache, kMinSplats / steps);
  size_t splats = 0;
  for (const uint32_t brick : chosen) splats += steps * cache.bricks()[brick].splats;
  const VariableInfo info = variableFor(cache, variable, what);
  const size_t points = pointsPerSplat(splats);
  const double stretch = scale.x * scale.y * scale.z;
  const Sampling sampling{variable,
                          scale,
                          static_cast<float>(info.min),
                          static_cast<float>(info.max),
                          points,
                          stretch / static_cast<double>(points * steps)};

  CoarseSamples samples;
  samples.positions.reserve(splats * points);
  samples.values.reserve(splats * points);
  samples.volumes.reserve(splats * points);
  CubePoints places;
  if (steps == 1) {
    addSamples(cache, chosen, sampling, places, samples);
    return samples;
  }
  for (uint64_t n = 0; n < steps; ++n) {
    const CacheReader at_step = cache.atStep(n * (of_series - 1) / (steps - 1));
    addSamples(at_step, bricksAtALevel(at_step, kMinSplats / steps), sampling, places, samples);
  }
  return samples;
}

CoarseSamples samplesIn(const CoarseSamples& samples, const glm::dvec3& lower, const glm::dvec3& upper) {
  CoarseSamples inside;
  for (size_t n = 0; n < samples.size(); ++n) {
    const glm::dvec3& position = samples.positions[n];
    if (!glm::all(glm::lessThanEqual(lower, position)) || !glm::all(glm::lessThanEqual(position, upper)))
      continue;
    inside.positions.push_back(position);
    inside.values.push_back(samples.values[n]);
    inside.volumes.push_back(samples.volumes[n]);
    inside.volume += samples.volumes[n];
  }
  return inside;
}

}  // namespace curvisplat
