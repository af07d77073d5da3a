#include "tools/view/edited_function.h"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "render/colour/control_points.h"
#include "render/colour/function_parts.h"
#include "stream/base/error.h"
#include "stream/cache/coarse_level.h"
#include "stream/cache/value_histogram.h"

namespace curvisplat {
namespace {

template <typename Point, typename Map>
void mapPoints(std::vector<Point>& points, const Map& map) {
  for (Point& point : points) point.x = map(point.x);
}

}  // namespace

EditedFunction::EditedFunction(const std::string& preset, double low, double high, double opacity_unit)
    : definition_(presetDefinition(preset)),
      range_(intervalAround(low, high)),
      opacity_unit_(opacity_unit),
      preset_(preset),
      map_(preset) {
  CURVISPLAT_CHECK_OP(opacity_unit, >, 0);
}

EditedFunction::EditedFunction(const TransferFunctionDefinition& definition, double default_opacity_unit)
    : definition_(definition),
      opacity_unit_(definition.opacity_unit > 0 ? definition.opacity_unit : default_opacity_unit) {
  range_ = TransferFunction(definition, nullptr, opacity_unit_)
               .range();  // checks the range of a logarithmic scale
  if (definition_.opacities.empty())
    definition_.opacities = defaultOpacityRamp(definition_.colours.front().x, definition_.colours.back().x);
  const auto coordinate = [&](double x) { return definition_.log_scale ? std::log10(x) : x; };
  const double begin = coordinate(range_.first), length = coordinate(range_.second) - begin;
  const auto toUnit = [&](double x) { return std::clamp((coordinate(x) - begin) / length, 0.0, 1.0); };
  mapPoints(definition_.colours, toUnit);
  mapPoints(definition_.opacities, toUnit);
  // Beyond its end points a curve is constant.
  auto& points = definition_.opacities;
  if (points.front().x > 0) points.insert(points.begin(), {0, points.front().opacity});
  if (points.back().x < 1) points.push_back({1, points.back().opacity});
  auto& colours = definition_.colours;
  if (colours.front().x > 0) colours.insert(colours.begin(), {0, colours.front().rgb});
  if (colours.back().x < 1) colours.push_back({1, colours.back().rgb});
}

EditedFunction::EditedFunction(const FunctionParts& parts)
    : EditedFunction(parts.map, parts.range.first, parts.range.second, parts.opacity_unit) {
  range_ = parts.range;
  asinh_ = parts.asinh;
  if (parts.opacities.empty()) return;
  definition_.opacities = parts.opacities;
  edited();
}

EditedFunction EditedFunction::automatic(const FunctionParts& parts) {
  EditedFunction function(parts);
  function.setAutomatic();
  return function;
}

std::optional<FunctionParts> EditedFunction::parts(bool rounded) const {
  constexpr int kDigits = 6, kPointDigits = 4;
  constexpr size_t kMaxPoints = 24;
  const auto is_plain = [](const OpacityPoint& p) { return p.midpoint == 0.5 && p.sharpness == 0; };
  if (map_.empty() || logScale() || points().size() > kMaxPoints ||
      !std::all_of(points().begin(), points().end(), is_plain))
    return std::nullopt;
  FunctionParts parts{map_, range_, asinh_, {}, opacity_unit_};
  if (preset_ != map_ || asinh_) parts.opacities = points();
  if (!rounded) return parts;
  const double span = range_.second - range_.first;
  parts.range = {roundedTo(range_.first, span, kDigits), roundedTo(range_.second, span, kDigits)};
  if (!(parts.range.first < parts.range.second)) parts.range = range_;
  parts.opacity_unit = roundedTo(opacity_unit_, opacity_unit_, kDigits);
  for (OpacityPoint& point : parts.opacities)
    point = {roundedTo(point.x, 1, kPointDigits),
             point.opacity > 0 ? roundedTo(point.opacity, point.opacity, kPointDigits) : 0};
  return parts;
}

TransferFunction EditedFunction::function() const {
  if (asinh_) return TransferFunction(definition(), nullptr, opacity_unit_);
  return TransferFunction(definition_, &range_, opacity_unit_);
}

TransferFunctionDefinition EditedFunction::definition() const {
  TransferFunctionDefinition definition = definition_;
  definition.opacity_unit = opacity_unit_;
  if (asinh_) return spreadOver(std::move(definition), range_, asinh_);
  const auto toScalar = [&](double x) { return scalarAt(x); };
  mapPoints(definition.colours, toScalar);
  mapPoints(definition.opacities, toScalar);
  return definition;
}

bool EditedFunction::setRange(double low, double high) {
  if (!(low < high) || !std::isfinite(high - low) || (logScale() && !(low > 0))) return false;
  range_ = {low, high};
  return true;
}

void EditedFunction::fitRange(double low, double high) {
  asinh_.reset();  // its centre is of the data
  if (logScale() && !(low > 0)) setLogScale(false);
  const auto [from, to] = intervalAround(low, high);
  setRange(from, to);
}

bool EditedFunction::setLogScale(bool log_scale) {
  if (log_scale == logScale()) return true;
  if (log_scale && !(range_.first > 0)) return false;
  definition_.log_scale = log_scale;
  asinh_.reset();
  edited();
  return true;
}

void EditedFunction::setLinear() {
  definition_.log_scale = false;
  asinh_.reset();
  edited();
}

void EditedFunction::setOpacityUnit(double unit) {
  if (unit > 0 && std::isfinite(unit)) opacity_unit_ = unit;
}

size_t EditedFunction::addPoint(double x, double opacity) {
  auto& points = definition_.opacities;
  const auto next =
      std::find_if(points.begin() + 1, points.end() - 1, [&](const OpacityPoint& p) { return p.x > x; });
  const auto added = points.insert(next, {std::clamp(x, 0.0, 1.0), std::clamp(opacity, 0.0, 1.0)});
  edited();
  return static_cast<size_t>(added - points.begin());
}

void EditedFunction::suitBackground(bool dark) {
  const DefaultMaps& wanted = dark ? kMapsOnDark : kMapsOnLight;
  const DefaultMaps& other = dark ? kMapsOnLight : kMapsOnDark;
  const bool sequential = map_ == other.sequential;
  if (!isAutomatic() || (!sequential && map_ != other.diverging)) return;
  setColours(sequential ? wanted.sequential : wanted.diverging);
  setAutomatic();
}

void EditedFunction::setOpacities(std::vector<OpacityPoint> points) {
  CURVISPLAT_CHECK(points.size() >= 2);
  definition_.opacities = std::move(points);
  edited();
}

void EditedFunction::movePoint(size_t point, double x, double opacity) {
  auto& points = definition_.opacities;
  CURVISPLAT_CHECK_OP(point, <, points.size());
  points[point].opacity = std::clamp(opacity, 0.0, 1.0);
  if (point > 0 && point + 1 < points.size())
    points[point].x = std::clamp(x, points[point - 1].x, points[point + 1].x);
  edited();
}

void EditedFunction::movePointsTogether(double by) {
  const std::span<OpacityPoint> all(definition_.opacities);
  if (all.size() < 3) return;
  const std::span<OpacityPoint> moved = all.subspan(1, all.size() - 2);
  by = std::clamp(by, -moved.front().x, 1 - moved.back().x);
  for (OpacityPoint& point : moved) point.x += by;
  edited();
}

void EditedFunction::removePoint(size_t point) {
  auto& points = definition_.opacities;
  if (point == 0 || point + 1 >= points.size()) return;
  points.erase(points.begin() + static_cast<ptrdiff_t>(point));
  edited();
}

void EditedFunction::setColours(const std::string& preset) {
  const TransferFunctionDefinition from = presetDefinition(preset);
  definition_.colours = from.colours;
  definition_.colour_space = from.colour_space;
  definition_.name = from.name;
  edited();
  map_ = preset;
}

void EditedFunction::thinColours() {
  constexpr size_t kMax = 12, kThinned = 9;
  if (definition_.colours.size() <= kMax) return;
  std::vector<ColourPoint> thinned;
  for (size_t n = 0; n < kThinned; ++n) {
    const double x = static_cast<double>(n) / (kThinned - 1);
    thinned.push_back({x, colourAt(x)});
  }
  definition_.colours = std::move(thinned);
  definition_.colour_space = ColourSpace::kLab;
  coloursEdited();
}

void EditedFunction::setColour(size_t point, const glm::dvec3& rgb) {
  CURVISPLAT_CHECK_OP(point, <, definition_.colours.size());
  definition_.colours[point].rgb = glm::clamp(rgb, glm::dvec3(0), glm::dvec3(1));
  coloursEdited();
}

void EditedFunction::moveColour(size_t point, double x) {
  auto& colours = definition_.colours;
  if (point == 0 || point + 1 >= colours.size()) return;
  colours[point].x = std::clamp(x, colours[point - 1].x, colours[point + 1].x);
  coloursEdited();
}

size_t EditedFunction::addColour(double x) {
  auto& colours = definition_.colours;
  const ColourPoint added{std::clamp(x, 0.0, 1.0), colourAt(x)};
  const auto next = std::find_if(colours.begin() + 1, colours.end() - 1,
                                 [&](const ColourPoint& point) { return point.x > added.x; });
  const auto at = colours.insert(next, added);
  coloursEdited();
  return static_cast<size_t>(at - colours.begin());
}

void EditedFunction::removeColour(size_t point) {
  auto& colours = definition_.colours;
  if (point == 0 || point + 1 >= colours.size()) return;
  colours.erase(colours.begin() + static_cast<ptrdiff_t>(point));
  coloursEdited();
}

glm::dvec3 EditedFunction::colourAt(double x) const {
  return ColourMap(definition_.colours, definition_.colour_space).at(x);
}

namespace {

constexpr uint64_t kMinSplats = 20'000;

/// The volume of `stored` in `bins` bins of the function's coordinate; empty if one of its own bins in the
/// function's range is wider than one of these.
std::optional<std::vector<double>> dividedAnew(const ValueHistogram& stored, const EditedFunction& function,
                                               size_t bins) {
  const auto [low, high] = function.range();
  const auto count = static_cast<double>(bins);
  const auto binAt = [&](double value) { return std::clamp(function.coordinateOf(value), 0.0, 1.0) * count; };
  std::vector<double> shares(bins, 0.0);
  for (size_t bin = 0; bin < kHistogramBins; ++bin) {
    const double width = stored.binWidth();
    const double begin = stored.lower + static_cast<double>(bin) * width, end = begin + width;
    if (end < low || begin > high) continue;
    const double inside_begin = std::max(begin, low), inside_end = std::min(end, high);
    const double first = binAt(inside_begin), last = binAt(inside_end);
    if (last - first > 1) return std::nullopt;
    const double share =
        width > 0 ? stored.shares[bin] * (inside_end - inside_begin) / width : double{stored.shares[bin]};
    // It lies in one bin, or in two that follow one another.
    const auto own = std::min(bins - 1, static_cast<size_t>(first));
    const double in_own =
        last > first ? std::min(1.0, (static_cast<double>(own + 1) - first) / (last - first)) : 1;
    shares[own] += share * in_own;
    shares[std::min(bins - 1, own + 1)] += share * (1 - in_own);
  }
  return shares;
}

}  // namespace

std::vector<double> histogramOf(const CacheReader& cache, size_t variable, const EditedFunction& function,
                                size_t bins) {
  if (const auto stored = stepHistogram(cache, variable))
    if (auto shares = dividedAnew(*stored, function, bins)) return *std::move(shares);
  const auto [low, high] = function.range();
  std::vector<double> volumes(bins, 0.0);
  double total = 0;
  SplatGeometry geometry;
  SplatVariable values;
  for (const uint32_t brick : bricksAtALevel(cache, kMinSplats)) {
    try {
      cache.readGeometry(brick, geometry);
      cache.readVariable(brick, variable, values);
    } catch (const DamagedBrick&) {
      continue;  // drawing it reports it
    }
    for (size_t n = 0; n < values.size(); ++n) {
      total += geometry.weight[n];
      const double value = values.mean[n];
      if (!(value >= low && value <= high)) continue;
      const double part = std::clamp(function.coordinateOf(value), 0.0, 1.0);
      volumes[std::min(bins - 1, static_cast<size_t>(part * static_cast<double>(bins)))] +=
          geometry.weight[n];
    }
  }
  if (total > 0)
    for (double& volume : volumes) volume /= total;
  return volumes;
}

}  // namespace curvisplat
