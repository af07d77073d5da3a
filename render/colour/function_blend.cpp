#include "render/colour/function_blend.h"

#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace curvisplat {
namespace {

constexpr int kEvenPlaces = 256;

/// The space in which two colours of a map are blended. Msh would put white between distinct hues.
ColourSpace blendingSpace(ColourSpace space) {
  if (space == ColourSpace::kDiverging) return ColourSpace::kLab;
  return space == ColourSpace::kStep ? ColourSpace::kRgb : space;
}

/// The scalars between the ends of a curve, whose points are shares of it.
struct Span {
  double first = 0, length = 1;

  template <typename Point>
  explicit Span(const std::vector<Point>& points)
      : first(points.front().x), length(points.back().x - points.front().x) {}
  double shareOf(double x) const { return length > 0 ? (x - first) / length : 0; }
  double at(double share) const { return first + share * length; }
};

/// Puts `points`, one for each of `a` and `b`, where these are `part` of the way from one to the other: along the range, which
/// moves as well.
template <typename Point>
void movePoints(const std::vector<Point>& a, const std::vector<Point>& b, double part,
                std::vector<Point>& points) {
  const Span from(a), to(b);
  for (size_t n = 0; n < points.size(); ++n) {
    const double share = std::lerp(from.shareOf(a[n].x), to.shareOf(b[n].x), part);
    points[n].x = std::lerp(from.at(share), to.at(share), part);
  }
}

/// The shares of the range at which either curve has a point, and `more` even ones. A jump is there twice.
template <typename Point>
std::vector<double> placesOf(const std::vector<Point>& a, const std::vector<Point>& b, int more) {
  std::vector<double> places;
  for (const std::vector<Point>* points : {&a, &b})
    for (const Point& point : *points) places.push_back(Span(*points).shareOf(point.x));
  for (int n = 0; n <= more; ++n) places.push_back(more > 0 ? static_cast<double>(n) / more : 0);
  std::ranges::sort(places);
  return places;
}

/// Blends two curves at places of their ranges. `evaluate(curve, x)`; `make(x, a, b)`.
template <typename Point, typename Curve, typename Blend>
std::vector<Point> blendedCurve(const std::array<std::vector<Point>, 2>& points,
                                const std::array<Curve, 2>& curves, double part, int more,
                                const Blend& blend) {
  const std::array<Span, 2> spans{Span(points[0]), Span(points[1])};
  std::vector<Point> result;
  double before = -1;
  for (const double place : placesOf(points[0], points[1], more)) {
    const bool again = place == before;  // at a jump the first point holds; the second is what follows
    before = place;
    const auto value = [&](size_t of) {
      const double x = spans[of].at(place);
      return curves[of].at(again ? std::nextafter(x, std::numeric_limits<double>::max()) : x);
    };
    result.push_back(blend(std::lerp(spans[0].at(place), spans[1].at(place), part), value(0), value(1)));
  }
  return result;
}

std::vector<OpacityPoint> opacitiesOf(const TransferFunctionDefinition& function) {
  if (!function.opacities.empty()) return function.opacities;
  return defaultOpacityRamp(function.colours.front().x, function.colours.back().x);
}

void blendColours(const TransferFunctionDefinition& a, const TransferFunctionDefinition& b, double part,
                  TransferFunctionDefinition& result) {
  if (a.colours.size() == b.colours.size() && a.colour_space == b.colour_space) {
    movePoints(a.colours, b.colours, part, result.colours);
    for (size_t n = 0; n < a.colours.size(); ++n) {
      const std::array<ColourPoint, 2> both{ColourPoint{0, a.colours[n].rgb},
                                            ColourPoint{1, b.colours[n].rgb}};
      if (both[0].rgb != both[1].rgb)
        result.colours[n].rgb = ColourMap(both, blendingSpace(a.colour_space)).at(part);
    }
    return;
  }
  result.colour_space = ColourSpace::kRgb;
  result.colours = blendedCurve<ColourPoint, ColourMap>(
      {a.colours, b.colours}, {ColourMap(a.colours, a.colour_space), ColourMap(b.colours, b.colour_space)},
      part, kEvenPlaces, [part](double x, const glm::dvec3& from, const glm::dvec3& to) {
        return ColourPoint{x, glm::mix(from, to, part)};
      });
}

void blendOpacities(const TransferFunctionDefinition& a, const TransferFunctionDefinition& b, double part,
                    TransferFunctionDefinition& result) {
  const std::array<std::vector<OpacityPoint>, 2> points{opacitiesOf(a), opacitiesOf(b)};
  if (points[0].size() == points[1].size()) {
    result.opacities = points[0];
    for (size_t n = 0; n < points[0].size(); ++n) {
      const OpacityPoint &from = points[0][n], &to = points[1][n];
      result.opacities[n] = {0, std::lerp(from.opacity, to.opacity, part),
                             std::lerp(from.midpoint, to.midpoint, part),
                             std::lerp(from.sharpness, to.sharpness, part)};
    }
    movePoints(points[0], points[1], part, result.opacities);
    return;
  }
  const auto is_curved = [](const OpacityPoint& p) { return p.midpoint != 0.5 || p.sharpness != 0; };
  const bool curved = std::ranges::any_of(points[0], is_curved) || std::ranges::any_of(points[1], is_curved);
  result.opacities = blendedCurve<OpacityPoint, OpacityCurve>(
      points, {OpacityCurve(points[0]), OpacityCurve(points[1])}, part, curved ? kEvenPlaces : 0,
      [part](double x, double from, double to) {
        return OpacityPoint{x, std::lerp(from, to, part)};
      });
}

}  // namespace

TransferFunctionDefinition blended(const TransferFunctionDefinition& from,
                                   const TransferFunctionDefinition& to, double part) {
  TransferFunctionDefinition result = from;
  blendColours(from, to, part, result);
  blendOpacities(from, to, part, result);
  if (from.asinh && to.asinh)
    result.asinh = AsinhScale{std::lerp(from.asinh->centre, to.asinh->centre, part),
                              std::lerp(from.asinh->width, to.asinh->width, part)};
  else
    result.asinh.reset();
  result.opacity_unit = std::exp(std::lerp(std::log(from.opacity_unit), std::log(to.opacity_unit), part));
  return result;
}

}  // namespace curvisplat
