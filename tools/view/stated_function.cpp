#include "tools/view/stated_function.h"

#include <glm/common.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "render/colour/control_points.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kTolerance = 1e-6;  // of opacities, of colours and of the range

bool isSameColour(const ColourPoint& a, const ColourPoint& b, double span) {
  const glm::dvec3 apart = glm::abs(a.rgb - b.rgb);
  return std::abs(a.x - b.x) <= kTolerance * span && std::max({apart.x, apart.y, apart.z}) <= kTolerance;
}

bool haveSameColours(const TransferFunctionDefinition& a, const TransferFunctionDefinition& b, double span) {
  return a.colour_space == b.colour_space &&
         std::ranges::equal(a.colours, b.colours, [span](const ColourPoint& one, const ColourPoint& other) {
           return isSameColour(one, other, span);
         });
}

bool isPlain(const OpacityPoint& point) {
  return point.midpoint == 0.5 && point.sharpness == 0;
}

/// Leaves out points on the line between their neighbours: a curve in asinh comes as many short lines.
std::vector<OpacityPoint> thinned(const std::vector<OpacityPoint>& points) {
  std::vector<OpacityPoint> kept;
  for (size_t n = 0; n < points.size(); ++n) {
    const OpacityPoint& point = points[n];
    if (n > 0 && n + 1 < points.size() && isPlain(kept.back()) && isPlain(point)) {
      const OpacityPoint &before = kept.back(), &next = points[n + 1];
      const double length = next.x - before.x;
      const double share = length > 0 ? (point.x - before.x) / length : 0;
      const double on_line = std::lerp(before.opacity, next.opacity, share);
      if (length > 0 && std::abs(on_line - point.opacity) <= kTolerance) continue;
    }
    kept.push_back(point);
  }
  return kept;
}

/// Whether both have the same opacities, which are lines in the scalar for one and perhaps in asinh for the other.
bool haveSameOpacities(const TransferFunctionDefinition& a, const TransferFunctionDefinition& b) {
  constexpr double kSeen = 1e-4;
  const OpacityCurve of_a(a.opacities), of_b(b.opacities);
  const auto is_same = [&](const OpacityPoint& point) {
    return std::abs(of_a.at(point.x) - of_b.at(point.x)) <= kSeen;
  };
  return std::ranges::all_of(a.opacities, is_same) && std::ranges::all_of(b.opacities, is_same);
}

/// The opacities along the range of `parts`, from its one end to the other.
std::vector<OpacityPoint> opacitiesAlong(const FunctionParts& parts, std::vector<OpacityPoint> points) {
  const ScalarAxis axis{parts.range, false, parts.asinh};
  for (OpacityPoint& point : points) point.x = std::clamp(axis.fractionOf(point.x), 0.0, 1.0);
  if (points.front().x > 0) points.insert(points.begin(), {0, points.front().opacity});
  if (points.back().x < 1) points.push_back({1, points.back().opacity});
  return thinned(points);
}

}  // namespace

std::optional<FunctionParts> partsOfPoints(const TransferFunctionDefinition& points,
                                           const std::optional<FunctionParts>& like, double opacity_unit) {
  if (points.log_scale || points.colours.size() < 2 || points.opacities.size() < 2) return std::nullopt;
  const std::pair<double, double> range{points.colours.front().x, points.colours.back().x};
  const double span = range.second - range.first;
  if (!(span > 0)) return std::nullopt;
  std::vector<FunctionParts> tried;
  if (like && like->asinh && like->range == range) tried.push_back(*like);  // with its few points
  if (like) tried.push_back({like->map, range, like->asinh, {}, opacity_unit});
  tried.push_back({points.name, range, std::nullopt, {}, opacity_unit});
  for (FunctionParts& parts : tried) try {
      if (!haveSameColours(parts.definition(), points, span)) continue;
      if (parts.opacities.empty()) parts.opacities = opacitiesAlong(parts, points.opacities);
      if (points.opacity_unit > 0) parts.opacity_unit = points.opacity_unit;
      if (haveSameOpacities(parts.definition(), points)) return parts;
    } catch (const UsageError&) {  // there is no map of this name
    }
  return std::nullopt;
}

}  // namespace curvisplat
