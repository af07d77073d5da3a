#include "render/colour/transfer_function.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kLargestOpacity = 0.9999;
// Smallest width of a range, which classification divides by in single precision.
constexpr double kMinLength = 1e-30;

bool isConstant(double low, double high) {
  return low <= high && high - low < kMinLength;
}

double toCoordinate(double scalar, bool log_scale) {
  if (!log_scale) return scalar;
  return scalar > 0 ? std::log10(scalar) : -std::numeric_limits<double>::infinity();
}

/// Converts the points' x to the coordinate of interpolation, stretched over `range` (in that coordinate) if
/// given.
template <typename Point>
void place(std::vector<Point>& points, bool log_scale,
           const std::optional<std::pair<double, double>>& range) {
  // A map that is to be stretched may be written over any interval, mostly 0..1. The logarithm of its own
  // ends is taken only if they have one, as in ParaView.
  const bool own_log = log_scale && points.front().x > 0;
  for (Point& point : points) point.x = toCoordinate(point.x, own_log);
  if (!range) return;
  const double begin = points.front().x, length = points.back().x - begin;
  for (Point& point : points) point.x = std::lerp(range->first, range->second, (point.x - begin) / length);
}

/// Checks points that are not stretched but interpolated in the logarithm.
template <typename Point>
void requirePositive(const std::vector<Point>& points, const std::string& origin) {
  if (!points.empty() && !(points.front().x > 0))
    throw Error(
        "{}, field UseLogScale: its points begin at {}, which has no logarithm; give a range above zero with "
        "--range",
        origin, points.front().x);
}

}  // namespace

TransferFunction::TransferFunction(TransferFunctionDefinition definition,
                                   const std::pair<double, double>* range, double opacity_unit)
    : name_(std::move(definition.name)),
      log_scale_(definition.log_scale),
      asinh_(definition.asinh),
      opacity_unit_(opacity_unit),
      nan_colour_(definition.nan_colour),
      notes_(std::move(definition.notes)) {
  CURVISPLAT_CHECK_OP(opacity_unit, >, 0);
  std::optional<std::pair<double, double>> stretched;
  if (range) {
    if (!(range->second - range->first >= kMinLength))
      throw UsageError("the range {},{} of a transfer function must increase, by {:g} or more", range->first,
                       range->second, kMinLength);
    if (log_scale_ && !(range->first > 0))
      throw UsageError("{} has a logarithmic scale: the range {},{} must be above zero", definition.origin,
                       range->first, range->second);
    stretched.emplace(toCoordinate(range->first, log_scale_), toCoordinate(range->second, log_scale_));
  } else if (log_scale_) {
    requirePositive(definition.colours, definition.origin);
    requirePositive(definition.opacities, definition.origin);
  }
  place(definition.colours, log_scale_, stretched);
  if (definition.opacities.empty())
    definition.opacities = defaultOpacityRamp(definition.colours.front().x, definition.colours.back().x);
  else
    place(definition.opacities, log_scale_, stretched);

  const double low = std::min(definition.colours.front().x, definition.opacities.front().x);
  const double high = std::max(definition.colours.back().x, definition.opacities.back().x);
  range_ = log_scale_ ? std::pair(std::pow(10, low), std::pow(10, high)) : std::pair(low, high);
  if (range) range_ = *range;
  colours_ = ColourMap(definition.colours, definition.colour_space);
  opacities_ = OpacityCurve(definition.opacities);
}

std::pair<double, double> intervalAround(double low, double high) {
  if (!isConstant(low, high)) return {low, high};
  const double margin = low == 0 ? 1 : std::max(1e-3 * std::abs(low), kMinLength);
  return {low - margin, high + margin};
}

TransferFunction TransferFunction::preset(std::string_view name, double low, double high,
                                          double opacity_unit) {
  const std::pair<double, double> range = intervalAround(low, high);
  TransferFunctionDefinition definition = presetDefinition(name);
  if (isConstant(low, high))
    definition.notes.push_back(
        fmt::format("the scalar is {} everywhere; it is drawn in the middle of the preset '{}'", low, name));
  return TransferFunction(std::move(definition), &range, opacity_unit);
}

TransferFunction TransferFunction::fromFile(const std::filesystem::path& path,
                                            const std::pair<double, double>* range, double opacity_unit,
                                            double default_opacity_unit) {
  TransferFunctionDefinition definition = readParaViewPreset(path);
  if (!(opacity_unit > 0)) opacity_unit = definition.opacity_unit;
  if (!(opacity_unit > 0)) opacity_unit = default_opacity_unit;
  return TransferFunction(std::move(definition), range, opacity_unit);
}

double TransferFunction::coordinate(double scalar) const {
  return toCoordinate(scalar, log_scale_);
}

TransferFunction::Value TransferFunction::at(double scalar) const {
  if (std::isnan(scalar)) return {nan_colour_, 0};
  return {colours_.at(coordinate(scalar)), extinctionAt(scalar)};
}

double TransferFunction::extinctionAt(double scalar) const {
  if (std::isnan(scalar)) return 0;
  const double opacity = std::min(opacities_.at(coordinate(scalar)), kLargestOpacity);
  return -std::log1p(-opacity) / opacity_unit_;
}

}  // namespace curvisplat
