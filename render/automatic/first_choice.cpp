#include "render/automatic/first_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <iterator>
#include <numeric>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "render/automatic/coarse_samples.h"
#include "render/automatic/opacity_rule.h"
#include "render/automatic/view_rule.h"
#include "render/colour/function_parts.h"
#include "stream/base/component_name.h"

namespace curvisplat {
namespace {

constexpr double kConstant = 1e-4;
constexpr double kMeanDepth = 1.05;  // over what is seen: an absorption of 65 %
// The mean depth that values have at least which would be clear: of materials, and of what surrounds that which is seen in less than
// kContext of the silhouette.
constexpr double kMaterialsDepth = 0.6, kTwoMaterialsDepth = 0.3, kContextDepth = 0.15, kContext = 0.6;
constexpr double kDivergingShare = 0.25;   // of the lesser sign, in the interval: of the other's length
constexpr double kDivergingVolume = 0.02;  // of the lesser sign, in the volume that is not zero
constexpr int kRangeDigits = 3, kUnitDigits = 3;

bool isDiverging(const std::string& map) {
  const auto maps = builtInMaps();
  return std::any_of(maps.begin(), maps.end(), [&](const PublishedMap& one) {
    return one.name == map && one.category == MapCategory::kDiverging;
  });
}

/// [sample]: its volume times the function's extinction.
std::vector<double> depthsOf(const CoarseSamples& samples, const TransferFunction& function) {
  std::vector<double> depths(samples.size());
  for (size_t n = 0; n < depths.size(); ++n)
    depths[n] = samples.volumes[n] * function.extinctionAt(samples.values[n]);
  return depths;
}

}  // namespace

bool isNearlyConstant(const VariableInfo& variable) {
  // A range that is too narrow for a transfer function is one value, too.
  if (intervalAround(variable.min, variable.max).first < variable.min) return true;
  return !(variable.max - variable.min >
           kConstant * std::max(std::abs(variable.min), std::abs(variable.max)));
}

namespace {

/// Whether the component varies by no more than rounding errors of the vector's or tensor's largest component.
bool isNoise(const VariableInfo& component, std::span<const VariableInfo> variables) {
  constexpr double kRounding = 1e-6;
  const std::string_view vector = vectorOf(component.name);
  double largest = 0;
  for (const VariableInfo& other : variables)
    if (!vector.empty() && vectorOf(other.name) == vector)
      largest = std::max({largest, std::abs(other.min), std::abs(other.max)});
  return component.max - component.min < kRounding * largest;
}

}  // namespace

size_t firstVaryingVariable(const Manifest& manifest) {
  std::optional<size_t> first;
  ScalarKind best{};
  for (size_t n = 0; n < manifest.variables.size(); ++n) {
    const VariableInfo& variable = manifest.variables[n];
    if (isNearlyConstant(variable)) continue;
    const ScalarKind kind =
        isNoise(variable, manifest.variables) ? ScalarKind::kNumbering : kindOf(variable.name);
    if (first && kind >= best) continue;
    first = n;
    best = kind;
  }
  return first.value_or(0);
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

/// Functions that suit a histogram of the data. Borrows all.
class FirstChoice::Fit {
 public:
  Fit(const FirstChoice& data, const VolumeHistogram& histogram, const std::string& map,
      const DefaultMaps& maps)
      : data_(data), histogram_(histogram), extinctions_(extinctionsOf(histogram)), map_(map), maps_(maps) {}

  struct Fitted {
    FunctionParts parts;
    bool is_diverging = false;  // zero is in the middle of the range
  };
  /// A function of the interval [begin, end] of the histogram's axis. nullopt: its ends are one number in a few digits.
  std::optional<Fitted> over(double begin, double end) const;
  /// A function of the interval outside of which little is seen.
  std::optional<Fitted> overSeen() const {
    const auto [begin, end] = seenInterval(histogram_, extinctions_);
    return over(begin, end);
  }
  /// A function of the part of the interval that is seen with this one; this one where that is not much smaller.
  FunctionParts narrowed(const Fitted& whole) const;

 private:
  /// Whether the interval has much of both signs. Where no map is named, so has the volume: a few overshoots beyond zero do not make a
  /// field of two signs.
  bool diverges(double begin, double end) const;
  double beginOf(const FunctionParts& parts) const { return histogram_.coordinate(parts.range.first); }
  double endOf(const FunctionParts& parts) const { return histogram_.coordinate(parts.range.second); }

  const FirstChoice& data_;
  const VolumeHistogram& histogram_;
  const BinExtinctions extinctions_;
  const std::string& map_;
  const DefaultMaps& maps_;
};

bool FirstChoice::Fit::diverges(double begin, double end) const {
  const double zero = histogram_.coordinate(0), below = zero - begin, above = end - zero;
  if (!(below > 0 && above > 0 && std::min(below, above) > kDivergingShare * std::max(below, above)))
    return false;
  if (!map_.empty()) return isDiverging(map_);
  const size_t bin_of_zero = histogram_.binOf(0);
  double negative = 0, positive = 0;
  for (size_t bin = 0; bin < VolumeHistogram::kBins; ++bin)
    if (bin != bin_of_zero) (bin < bin_of_zero ? negative : positive) += histogram_.shares[bin];
  return std::min(negative, positive) > kDivergingVolume * (negative + positive);
}

std::optional<FirstChoice::Fit::Fitted> FirstChoice::Fit::over(double begin, double end) const {
  const bool diverging = diverges(begin, end);
  const double low = histogram_.scalar(begin), high = histogram_.scalar(end);
  if (diverging) {
    const double zero = histogram_.coordinate(0), reach = std::max(zero - begin, end - zero);
    begin = zero - reach;
    end = zero + reach;
  }
  const auto rounded = [&](double coordinate) {
    const double scalar = histogram_.scalar(coordinate);
    const auto& asinh = histogram_.asinh;
    const double from = asinh ? std::abs(scalar - asinh->centre) + asinh->width : high - low;
    return roundedTo(scalar, from, kRangeDigits);
  };
  FunctionParts parts;
  parts.asinh = histogram_.asinh;
  parts.range = {rounded(begin), rounded(end)};
  if (!(parts.range.first < parts.range.second)) return std::nullopt;
  parts.opacities = opacityPoints(histogram_, extinctions_, beginOf(parts), endOf(parts));
  parts.map = !map_.empty() ? map_ : diverging ? maps_.diverging : maps_.sequential;
  parts.opacity_unit = data_.opacityUnitOf(parts.function());
  return Fitted{parts, diverging};
}

FunctionParts FirstChoice::Fit::narrowed(const Fitted& whole) const {
  const FunctionParts& parts = whole.parts;
  const auto interval =
      narrowedInterval(histogram_, data_.seenIn(histogram_, parts.function()), beginOf(parts), endOf(parts),
                       whole.is_diverging ? std::optional(histogram_.coordinate(0)) : std::nullopt);
  const auto narrower = interval ? over(interval->first, interval->second) : std::nullopt;
  return narrower ? narrower->parts : parts;
}

FunctionParts FirstChoice::function(const std::string& map, const DefaultMaps& maps, bool with_sheets) const {
  const auto histogram = distribution_ && !isNearlyConstant(variable_)
                             ? volumeHistogram(samples_, *distribution_)
                             : std::nullopt;
  const auto constant = [&] {
    FunctionParts parts = constantFunction();
    parts.map = map.empty() ? maps.sequential : map;
    return parts;
  };
  if (!histogram) return constant();
  const Fit fit(*this, *histogram, map, maps);
  if (const size_t values = fillingValues(*histogram); values > 1)
    if (const auto all = fit.over(histogram->low, histogram->high))
      return inHaze(values > 2 ? kMaterialsDepth : kTwoMaterialsDepth, all->parts);
  const auto whole = fit.overSeen();
  if (!whole) return constant();
  // Slices and faces show what the volume hides.
  const FunctionParts parts = with_sheets ? whole->parts : fit.narrowed(*whole);
  return isWithoutContext(parts.function()) ? inHaze(kContextDepth, parts) : parts;
}

bool FirstChoice::isWithoutContext(const TransferFunction& function) const {
  const std::vector<double> depths = depthsOf(samples_, function);
  return seenArea(samples_, silhouette_.view, depths) < kContext * silhouette_.area &&
         !showsAPart(samples_, silhouette_.view, depths);
}

FunctionParts FirstChoice::inHaze(double depth, FunctionParts parts) const {
  const double extinction = depth * silhouette_.area / samples_.volume;
  parts.opacities = raisedTo(-std::expm1(-extinction * parts.opacity_unit), std::move(parts.opacities));
  return parts;
}

BinWeights FirstChoice::seenIn(const VolumeHistogram& histogram, const TransferFunction& function) const {
  const SeenValues seen = seenValues(samples_, depthsOf(samples_, function), lower_, upper_);
  BinWeights weights{};
  for (size_t n = 0; n < seen.values.size(); ++n) weights[histogram.binOf(seen.values[n])] += seen.areas[n];
  return weights;
}

double FirstChoice::opacityUnitOf(const TransferFunction& function) const {
  const std::vector<double> depths = depthsOf(samples_, function);
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

ViewChoice FirstChoice::view(const TransferFunction& function, ImageSize size, Framed framed,
                             const glm::dvec3& lower, const glm::dvec3& upper) const {
  const auto chosen = [&](const CoarseSamples& samples, const Silhouette& silhouette) {
    return chooseView({samples, depthsOf(samples, function), silhouette, lower, upper}, size, framed);
  };
  if (glm::all(glm::lessThanEqual(lower, lower_)) && glm::all(glm::lessThanEqual(upper_, upper)))
    return chosen(samples_, silhouette_);
  const CoarseSamples inside = samplesIn(samples_, lower, upper);
  return chosen(inside, widestSilhouette(inside));
}

}  // namespace curvisplat
