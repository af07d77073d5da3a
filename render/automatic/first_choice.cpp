#include "render/automatic/first_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "render/automatic/coarse_samples.h"
#include "render/automatic/opacity_rule.h"
#include "render/colour/function_parts.h"

namespace curvisplat {
namespace {

constexpr double kConstant = 1e-4;
constexpr double kMeanDepth = 1.05;  // over what is seen: an absorption of 65 %
constexpr double kDivergingShare = 0.25;
constexpr double kUnseenPart = 0.01;  // of the extinction, beyond either side of the zoomed box
constexpr double kZoomMargin = 1.25, kWholeMargin = 1.15, kWorthZooming = 0.9, kMinZoomed = 0.25;
constexpr double kWorthCropping = 0.5;  // what can be seen has less than this part of the whole data's height
constexpr int kRangeDigits = 3, kUnitDigits = 3, kPlaceDigits = 4;

constexpr const char* kSequential = "viridis";
constexpr const char* kDiverging = "cool-warm-extended";

bool isDiverging(const std::string& map) {
  const auto maps = builtInMaps();
  return std::any_of(maps.begin(), maps.end(), [&](const PublishedMap& one) {
    return one.name == map && one.category == MapCategory::kDiverging;
  });
}

/// Numbers with weights, in bins by their size: a percentile sorts those of one bin alone.
class WeightedBins {
 public:
  /// Both must outlive it.
  WeightedBins(std::span<const double> numbers, std::span<const double> weights)
      : numbers_(numbers), weights_(weights) {
    const auto [least, most] = std::minmax_element(numbers_.begin(), numbers_.end());
    low_ = *least;
    high_ = *most;
    for (size_t n = 0; n < numbers_.size(); ++n) sums_[binOf(numbers_[n])] += weights_[n];
  }

  double low() const { return low_; }
  double high() const { return high_; }
  /// The number below which `part` of the weights lie.
  double percentile(double part) const {
    double left = part * std::accumulate(sums_.begin(), sums_.end(), 0.0);
    size_t bin = 0;
    while (bin + 1 < sums_.size() && sums_[bin] < left) left -= sums_[bin++];
    std::vector<std::pair<double, double>> weighted;
    for (size_t n = 0; n < numbers_.size(); ++n)
      if (binOf(numbers_[n]) == bin) weighted.emplace_back(numbers_[n], weights_[n]);
    std::sort(weighted.begin(), weighted.end());
    for (const auto& [number, weight] : weighted)
      if ((left -= weight) <= 0) return number;
    return weighted.empty() ? high_ : weighted.back().first;
  }

 private:
  size_t binOf(double number) const {
    const double place = (number - low_) / (high_ - low_) * static_cast<double>(sums_.size());
    return place < static_cast<double>(sums_.size()) ? static_cast<size_t>(place) : sums_.size() - 1;
  }

  std::span<const double> numbers_, weights_;
  double low_ = 0, high_ = 0;
  std::array<double, 1024> sums_{};
};

}  // namespace

bool isNearlyConstant(const VariableInfo& variable) {
  // A range that is too narrow for a transfer function is one value, too.
  if (intervalAround(variable.min, variable.max).first < variable.min) return true;
  return !(variable.max - variable.min >
           kConstant * std::max(std::abs(variable.min), std::abs(variable.max)));
}

size_t firstVaryingVariable(const Manifest& manifest) {
  const auto found = std::find_if_not(manifest.variables.begin(), manifest.variables.end(), isNearlyConstant);
  return found == manifest.variables.end() ? 0 : static_cast<size_t>(found - manifest.variables.begin());
}

FirstChoice::FirstChoice(const CacheReader& cache, size_t variable, const glm::dvec3& scale, ChosenFor what)
    : variable_(variableFor(cache, variable, what)),
      lower_(scale * cache.manifest().lower),
      upper_(scale * cache.manifest().upper),
      samples_(coarseSamples(cache, variable, scale, what)),
      silhouette_(widestSilhouette(samples_)) {
  if (samples_.size() > 0) distribution_.emplace(samples_);
}

FunctionParts FirstChoice::constantFunction() const {
  FunctionParts parts;
  parts.range = intervalAround(variable_.min, variable_.max);
  parts.opacities = {{0, 0.5}, {1, 0.5}};
  parts.opacity_unit = opacityUnitOf(parts.function());
  return parts;
}

FunctionParts FirstChoice::function(const std::string& map) const {
  FunctionParts parts;
  const auto with_map = [&](FunctionParts chosen, const char* preferred) {
    chosen.map = map.empty() ? preferred : map;
    return chosen;
  };
  if (!distribution_ || isNearlyConstant(variable_)) return with_map(constantFunction(), kSequential);
  const auto histogram = volumeHistogram(samples_, *distribution_);
  if (!histogram) return with_map(constantFunction(), kSequential);

  const BinExtinctions extinctions = extinctionsOf(*histogram);
  auto [begin, end] = seenInterval(*histogram, extinctions);
  const double zero = histogram->coordinate(0);
  const double below = zero - begin, above = end - zero;
  const bool diverging = (map.empty() || isDiverging(map)) && below > 0 && above > 0 &&
                         std::min(below, above) > kDivergingShare * std::max(below, above);
  const double low = histogram->scalar(begin), high = histogram->scalar(end);
  if (diverging) {
    const double reach = std::max(below, above);
    begin = zero - reach;
    end = zero + reach;
  }
  parts.asinh = histogram->asinh;
  const auto rounded = [&](double coordinate) {
    const double scalar = histogram->scalar(coordinate);
    const double from =
        histogram->asinh ? std::abs(scalar - histogram->asinh->centre) + histogram->asinh->width : high - low;
    return roundedTo(scalar, from, kRangeDigits);
  };
  parts.range = {rounded(begin), rounded(end)};
  if (!(parts.range.first < parts.range.second)) return with_map(constantFunction(), kSequential);
  parts.opacities = opacityPoints(*histogram, extinctions, histogram->coordinate(parts.range.first),
                                  histogram->coordinate(parts.range.second));
  parts = with_map(parts, diverging ? kDiverging : kSequential);
  parts.opacity_unit = opacityUnitOf(parts.function());
  return parts;
}

double FirstChoice::opacityUnitOf(const TransferFunction& function) const {
  std::vector<double> depths(samples_.size());
  for (size_t n = 0; n < samples_.size(); ++n)
    depths[n] = samples_.volumes[n] * function.extinctionAt(samples_.values[n]);
  const double depth = std::accumulate(depths.begin(), depths.end(), 0.0);
  const double area = seenArea(samples_, silhouette_.view, depths);
  const double unit = area > 0 ? function.opacityUnit() * depth / (kMeanDepth * area) : 0;
  if (unit > 0 && std::isfinite(unit)) return roundedTo(unit, unit, kUnitDigits);
  const double diagonal = glm::length(upper_ - lower_);
  return diagonal > 0 ? diagonal / 100 : 1;
}

double FirstChoice::percentile(double part) const {
  return distribution_ ? distribution_->percentile(part) : variable_.min;
}

ViewChoice FirstChoice::view(const TransferFunction& function, ImageSize size) const {
  ViewChoice choice{std::string(silhouette_.view)};
  if (samples_.size() == 0) return choice;
  const Camera whole = Camera::named(choice.view, lower_, upper_, size, Projection::kOrthographic);
  const glm::dmat4 view_from_world = whole.viewFromWorld();
  std::array<std::vector<double>, 2> places;  // along the picture's axes
  for (std::vector<double>& along : places) along.resize(samples_.size());
  std::vector<double> weights(samples_.size());
  double total = 0;
  for (size_t n = 0; n < samples_.size(); ++n) {
    const glm::dvec4 place = view_from_world * glm::dvec4(samples_.positions[n], 1);
    places[0][n] = place.x;
    places[1][n] = place.y;
    weights[n] = samples_.volumes[n] * function.extinctionAt(samples_.values[n]);
    total += weights[n];
  }
  if (!(total > 0)) return choice;
  glm::dvec2 from, to, lowest, highest;
  for (int axis = 0; axis < 2; ++axis) {
    const WeightedBins bins(places[static_cast<size_t>(axis)], weights);
    from[axis] = bins.percentile(kUnseenPart);
    to[axis] = bins.percentile(1 - kUnseenPart);
    lowest[axis] = bins.low();
    highest[axis] = bins.high();
  }
  const double aspect = static_cast<double>(size.width) / size.height;
  const auto halfHeight = [&](const glm::dvec2& a, const glm::dvec2& b, double margin) {
    return 0.5 * margin * std::max(b.y - a.y, (b.x - a.x) / aspect);
  };
  // Either all of the data, whose box may be much larger, or a small part in which there is something to be seen.
  const double all = halfHeight(lowest, highest, kWholeMargin);
  double needed = halfHeight(from, to, kZoomMargin);
  glm::dvec2 middle = 0.5 * (from + to);
  if (!(needed < kWorthCropping * all)) {
    needed = all;
    middle = 0.5 * (lowest + highest);
  }
  if (!(needed < kWorthZooming * whole.parallel_scale)) return choice;
  const glm::dmat4 world_from_view = glm::inverse(view_from_world);
  const glm::dvec4 centre = view_from_world * glm::dvec4(whole.focal_point, 1);
  const glm::dvec3 point(world_from_view * glm::dvec4(middle.x, middle.y, centre.z, 1));
  choice.parallel_scale = std::max(needed, kMinZoomed * whole.parallel_scale);
  glm::dvec3 rounded;
  for (int axis = 0; axis < 3; ++axis)
    rounded[axis] = roundedTo(point[axis], choice.parallel_scale, kPlaceDigits);
  choice.focal_point = rounded;
  choice.parallel_scale = roundedTo(choice.parallel_scale, choice.parallel_scale, kPlaceDigits - 1);
  return choice;
}

}  // namespace curvisplat
