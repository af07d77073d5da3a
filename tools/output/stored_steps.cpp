#include "tools/output/stored_steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "stream/cache/value_histogram.h"
#include "stream/codec/values_codec.h"

namespace curvisplat {
namespace {

constexpr double kStepsOfRange = 100, kStepsOfPart = 20, kLargestShare = 0.02, kWidestStep = 0.05;

/// How bricks are coded, by the scalar's spread as the histogram has it.
ValueCoding codingOf(const CacheReader& cache, const std::optional<ValueHistogram>& histogram) {
  ValueCoding coding{precisionOf(cache.manifest()), {}};
  if (histogram && !histogram->percentiles.empty())
    coding.spread = {histogram->percentile(0.5), histogram->percentile(0.95) - histogram->percentile(0.05)};
  return coding;
}

double stepOf(const CacheReader& cache, size_t variable, const ValueCoding& coding, double lower,
              double upper) {
  double step = 0;
  const auto bricks = cache.bricks();
  const auto values = cache.brickVariables(variable);
  for (size_t n = 0; n < bricks.size(); ++n) {
    const double least = values[n].min, most = values[n].max;
    if (!bricks[n].isLeaf() || most < lower || least > upper) continue;
    for (const double value : {std::max(least, lower), std::min(most, upper)})
      step = std::max(step, 2 * largestMeanError(coding, least, most, value));
  }
  return step;
}

std::string remedy(const CacheReader& cache) {
  switch (precisionOf(cache.manifest())) {
    case ValuePrecision::kFine:
      return "single precision has no finer ones";
    case ValuePrecision::kAuto:
      return "convert again with --value-precision fine";
    case ValuePrecision::kNormal:
      break;
  }
  return "convert again, with --value-precision auto or fine";
}

}  // namespace

double storedStep(const CacheReader& cache, size_t variable, double lower, double upper) {
  return stepOf(cache, variable, codingOf(cache, stepHistogram(cache, variable)), lower, upper);
}

std::string functionFinerThanStored(const CacheReader& cache, size_t variable,
                                    const TransferFunction& function) {
  struct Part {
    const char* name;
    double lower, upper, steps;
  };
  const auto [lower, upper] = function.range();
  std::vector<Part> parts{{"the range", lower, upper, kStepsOfRange}};
  if (const std::optional<AsinhScale> asinh = function.axis().asinh)
    parts.push_back({"the linear part of asinh,", std::max(lower, asinh->centre - asinh->width),
                     std::min(upper, asinh->centre + asinh->width), kStepsOfPart});
  if (function.logScale())
    parts.push_back({"the first decade,", lower, std::min(upper, 10 * lower), kStepsOfPart});
  for (const Part& part : parts) {
    const double step = storedStep(cache, variable, part.lower, part.upper);
    if (part.upper > part.lower && part.upper - part.lower < part.steps * step)
      return fmt::format(
          "{} {:.6g}..{:.6g} of {} is finer than its stored values, which have steps of up to {:.2g} "
          "there; {}",
          part.name, part.lower, part.upper, cache.manifest().variables[variable].name, step, remedy(cache));
  }
  return {};
}

std::vector<std::string> isovaluesFinerThanStored(const CacheReader& cache, size_t variable,
                                                  std::span<const std::string> isovalues) {
  std::vector<std::string> warnings;
  if (isovalues.empty()) return warnings;
  const std::optional<ValueHistogram> histogram = stepHistogram(cache, variable);
  const ValueCoding coding = codingOf(cache, histogram);
  for (const std::string& text : isovalues) {
    const double value = std::strtod(text.c_str(), nullptr);
    const double step = stepOf(cache, variable, coding, value, value);
    if (!histogram || !(step > 0)) continue;
    const std::string& name = cache.manifest().variables[variable].name;
    const double share = histogram->shareBelow(value + step) - histogram->shareBelow(value - step);
    if (share > kLargestShare)
      warnings.push_back(
          fmt::format("isovalue {} of {}: {:.0f} % of the volume lie within a step of its stored values, "
                      "{:.2g}, where the surface "
                      "follows their rounding; {}",
                      text, name, 100 * share, step, remedy(cache)));
    else if (step > kWidestStep * coding.spread.scaleAt(value) && coding.spread.scale > 0)
      warnings.push_back(fmt::format(
          "isovalue {} of {} is finer than its stored values, which have steps of up to {:.2g} there; {}",
          text, name, step, remedy(cache)));
  }
  return warnings;
}

}  // namespace curvisplat
