#include "render/automatic/stored_steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <tuple>
#include <utility>

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

/// A range of values.
struct ShownPart {
  double lower, upper;
};

/// Names the precisions that have steps below `step` there; `fine` has none in a long tail, since its steps are of the whole range.
std::string remedy(const CacheReader& cache, size_t variable, const ShownPart& part, double step,
                   const ValueSpread& spread) {
  std::string finer;
  for (const auto& [name, precision] :
       {std::pair("auto", ValuePrecision::kAuto), {"fine", ValuePrecision::kFine}})
    if (stepOf(cache, variable, {precision, spread}, part.lower, part.upper) < step)
      finer += finer.empty() ? name : std::string(" or ") + name;
  return finer.empty() ? "no precision stores finer ones there"
                       : "convert again with --value-precision " + finer;
}

std::vector<std::string> isovaluesFinerThanStored(const CacheReader& cache, const AskedIsovalues& asked) {
  std::vector<std::string> warnings;
  const size_t variable = asked.variable;
  const std::optional<ValueHistogram> histogram = stepHistogram(cache, variable);
  const ValueCoding coding = codingOf(cache, histogram);
  for (const double value : asked.values) {
    const double step = stepOf(cache, variable, coding, value, value);
    if (!histogram || !(step > 0)) continue;
    const std::string& name = cache.manifest().variables[variable].name;
    const double share = histogram->shareBelow(value + step) - histogram->shareBelow(value - step);
    if (share > kLargestShare)
      warnings.push_back(fmt::format(
          "isovalue {:.6g} of {}: {:.0f} % of the volume lie within a step of its stored values, {:.2g}, "
          "where "
          "the "
          "surface follows their rounding; {}",
          value, name, 100 * share, step, remedy(cache, variable, {value, value}, step, coding.spread)));
    else if (step > kWidestStep * coding.spread.scaleAt(value) && coding.spread.scale > 0)
      warnings.push_back(fmt::format(
          "isovalue {:.6g} of {} is finer than its stored values, which have steps of up to {:.2g} there; {}",
          value, name, step, remedy(cache, variable, {value, value}, step, coding.spread)));
  }
  return warnings;
}

}  // namespace

bool ShownAxis::operator==(const ShownAxis& other) const {
  const auto of = [](const ShownAxis& shown) {
    const AsinhScale asinh = shown.axis.asinh.value_or(AsinhScale{0, 0});  // a width that none has
    return std::tuple(shown.variable, shown.axis.range, shown.axis.log_scale, asinh.centre, asinh.width);
  };
  return of(*this) == of(other);
}

std::string axisFinerThanStored(const CacheReader& cache, const ShownAxis& shown) {
  struct Part {
    const char* name;
    double lower, upper, steps;
  };
  const ScalarAxis& axis = shown.axis;
  const auto [lower, upper] = axis.range;
  std::vector<Part> parts{{"the range", lower, upper, kStepsOfRange}};
  if (axis.asinh)
    parts.push_back({"the linear part of asinh,", std::max(lower, axis.asinh->centre - axis.asinh->width),
                     std::min(upper, axis.asinh->centre + axis.asinh->width), kStepsOfPart});
  if (axis.log_scale)
    parts.push_back({"the first decade,", lower, std::min(upper, 10 * lower), kStepsOfPart});
  const ValueCoding coding = codingOf(cache, stepHistogram(cache, shown.variable));
  for (const Part& part : parts) {
    const double step = stepOf(cache, shown.variable, coding, part.lower, part.upper);
    if (part.upper > part.lower && part.upper - part.lower < part.steps * step)
      return fmt::format(
          "{} {:.6g}..{:.6g} of {} is finer than its stored values, which have steps of up to {:.2g} "
          "there; {}",
          part.name, part.lower, part.upper, cache.manifest().variables[shown.variable].name, step,
          remedy(cache, shown.variable, {part.lower, part.upper}, step, coding.spread));
  }
  return {};
}

std::vector<std::string> finerThanStored(const CacheReader& cache, const AskedDifferences& asked) {
  std::vector<std::string> warnings;
  std::vector<size_t> warned;
  for (const ShownAxis& shown : asked.axes) {
    if (std::ranges::find(warned, shown.variable) != warned.end()) continue;
    std::string warning = axisFinerThanStored(cache, shown);
    if (warning.empty()) continue;
    warnings.push_back(std::move(warning));
    warned.push_back(shown.variable);
  }
  for (const AskedIsovalues& one : asked.isosurfaces)
    for (std::string& warning : isovaluesFinerThanStored(cache, one)) warnings.push_back(std::move(warning));
  return warnings;
}

}  // namespace curvisplat
