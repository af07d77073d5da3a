#include "tools/viewer/edited_function.h"

#include <algorithm>
#include <cmath>

#include "render/colour/colour_map.h"
#include "stream/base/check.h"

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
      preset_(preset) {
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

EditedFunction EditedFunction::automatic(const FunctionParts& parts) {
  EditedFunction function(parts.definition(), parts.opacity_unit);
  function.setAutomatic();
  return function;
}

TransferFunction EditedFunction::function() const {
  return TransferFunction(definition_, &range_, opacity_unit_);
}

TransferFunctionDefinition EditedFunction::definition() const {
  TransferFunctionDefinition definition = definition_;
  const auto [low, high] = range_;
  const auto toScalar = [&, low = low, high = high](double x) {
    if (x == 0) return low;
    if (x == 1) return high;
    return definition.log_scale ? low * std::pow(high / low, x) : std::lerp(low, high, x);
  };
  mapPoints(definition.colours, toScalar);
  mapPoints(definition.opacities, toScalar);
  definition.opacity_unit = opacity_unit_;
  return definition;
}

bool EditedFunction::setRange(double low, double high) {
  if (!(low < high) || !std::isfinite(high - low) || (logScale() && !(low > 0))) return false;
  range_ = {low, high};
  return true;
}

void EditedFunction::fitRange(double low, double high) {
  if (logScale() && !(low > 0)) setLogScale(false);
  const auto [from, to] = intervalAround(low, high);
  setRange(from, to);
}

bool EditedFunction::setLogScale(bool log_scale) {
  if (log_scale == logScale()) return true;
  if (log_scale && !(range_.first > 0)) return false;
  definition_.log_scale = log_scale;
  edited();
  return true;
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

void EditedFunction::movePoint(size_t point, double x, double opacity) {
  auto& points = definition_.opacities;
  CURVISPLAT_CHECK_OP(point, <, points.size());
  points[point].opacity = std::clamp(opacity, 0.0, 1.0);
  if (point > 0 && point + 1 < points.size())
    points[point].x = std::clamp(x, points[point - 1].x, points[point + 1].x);
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
}

glm::dvec3 EditedFunction::colourAt(double x) const {
  return ColourMap(definition_.colours, definition_.colour_space).at(x);
}

}  // namespace curvisplat
