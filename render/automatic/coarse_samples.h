// Points of a cache's data with a scalar's values, from a coarse level: what the function and the view of a
// first picture are chosen from.
//
// Every splat of the level is represented by the same number of points inside its cell, at places and with
// values that its shape, slope and variance give. The level is the coarsest with at least 50,000 splats, or
// the finest, so that time and memory are bounded: at most some 500,000 points (20 MB), 0.1 to 0.3 s.
//
// Seen from a side, the points cover areas: that of the whole data, its silhouette, and that in which a
// function shows something. Functions are pure, apart from reading the cache; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Structure of arrays; all have size() elements.
struct CoarseSamples {
  std::vector<glm::dvec3> positions;  // world units, after the scale factors
  std::vector<float> values;          // within the scalar's range
  std::vector<double> volumes;        // of the piece of space that the point stands for
  double volume = 0;                  // sum of `volumes`

  size_t size() const { return values.size(); }
};

/// The bricks of the coarsest level with at least `min_splats` splats, including leaves above that level.
std::vector<uint32_t> bricksAtALevel(const CacheReader& cache, uint64_t min_splats);

/// What a choice is made for: the step that the reader is at, or the whole series, of which five steps at
/// most stand for all.
enum class ChosenFor { kStep, kSeries };

/// The variable's range at the step, or over the series.
VariableInfo variableFor(const CacheReader& cache, size_t variable, ChosenFor what);

/// `scale`: factors that positions are multiplied with. Damaged bricks are left out; throws Error if the
/// disk fails. The same cache gives the same points.
CoarseSamples coarseSamples(const CacheReader& cache, size_t variable, const glm::dvec3& scale,
                            ChosenFor what = ChosenFor::kStep);

/// The area that the data covers when it is looked at from a side.
struct Silhouette {
  std::string_view view;  // as Camera::named() knows it
  double area = 0;        // world units squared
};

/// The silhouette from iso, unless a view along an axis shows more than 1.15 times its area. All samples
/// count, whatever their values: the box that the data lies in says nothing about a thin shell.
Silhouette widestSilhouette(const CoarseSamples& samples);

/// The area, in world units squared, in which a function shows something of the data from `view` (as
/// Camera::named() knows it): the parts of the silhouette whose optical depth is over 1 % of its mean.
/// `depths` [sample]: volume times extinction, not negative; the unit does not matter. 0 if all are 0.
double seenArea(const CoarseSamples& samples, std::string_view view, const std::vector<double>& depths);

}  // namespace curvisplat
