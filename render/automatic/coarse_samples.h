// Points of a cache's data with a scalar's values, from a coarse level: what the function and the view of a
// first picture are chosen from.
//
// Every splat of the level is represented by the same number of points inside its cell, at places and with
// values that its shape, slope and variance give. The level is the coarsest with at least 50,000 splats, or
// the finest, so that time and memory are bounded: at most some 500,000 points (20 MB), 0.1 to 0.3 s.
// Small grids have four points a splat, and at least 60,000.
// Functions are pure, apart from reading the cache; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "stream/cache/coarse_level.h"

namespace curvisplat {

/// Structure of arrays; all have size() elements.
struct CoarseSamples {
  std::vector<glm::dvec3> positions;  // world units, after the scale factors
  std::vector<float> values;          // within the scalar's range
  std::vector<double> volumes;        // of the piece of space that the point stands for
  double volume = 0;                  // sum of `volumes`

  size_t size() const { return values.size(); }
};

/// The range that a choice is made for: the step that the reader is at, or the whole series, of which five
/// steps at most stand for all.
enum class ChosenFor { kStep, kSeries };

/// The variable's range at the step, or over the series.
VariableInfo variableFor(const CacheReader& cache, size_t variable, ChosenFor what);

/// `scale`: factors that positions are multiplied with. Damaged bricks are left out; throws Error if the
/// disk fails. The same cache gives the same points.
CoarseSamples coarseSamples(const CacheReader& cache, size_t variable, const glm::dvec3& scale,
                            ChosenFor what = ChosenFor::kStep);

/// The samples in the box [lower, upper].
CoarseSamples samplesIn(const CoarseSamples& samples, const glm::dvec3& lower, const glm::dvec3& upper);

}  // namespace curvisplat
