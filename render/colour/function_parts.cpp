#include "render/colour/function_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

// Pieces that a curve in asinh is replaced by: straight lines in the scalar.
constexpr int kAsinhPieces = 256;

std::optional<double> parseUnit(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= 0 && value <= 1))
    return std::nullopt;
  return value;
}

}  // namespace

DefaultMaps mapsOn(const glm::vec4& background) {
  constexpr glm::vec3 kLuminance{0.2126f, 0.7152f, 0.0722f};
  const bool is_dark = background.a > 0.5f && glm::dot(kLuminance, glm::vec3(background)) < 0.5f;
  return is_dark ? kMapsOnDark : kMapsOnLight;
}

TransferFunctionDefinition FunctionParts::definition() const {
  TransferFunctionDefinition preset = presetDefinition(map);
  if (!opacities.empty()) preset.opacities = opacities;
  return spreadOver(std::move(preset), range, asinh);
}

TransferFunctionDefinition spreadOver(TransferFunctionDefinition definition, std::pair<double, double> range,
                                      const std::optional<AsinhScale>& asinh) {
  const auto [low, high] = range;
  if (!(low < high)) throw UsageError("the range {},{} of a transfer function must increase", low, high);
  if (!asinh) {
    for (ColourPoint& point : definition.colours) point.x = std::lerp(low, high, point.x);
    for (OpacityPoint& point : definition.opacities) point.x = std::lerp(low, high, point.x);
    return definition;
  }
  const ScalarAxis axis{range, false, asinh};
  const ColourMap colours(definition.colours, definition.colour_space);
  const OpacityCurve curve(definition.opacities);
  definition.colours.clear();
  definition.opacities.clear();
  definition.colour_space = ColourSpace::kRgb;
  definition.asinh = asinh;
  for (int piece = 0; piece <= kAsinhPieces; ++piece) {
    const double x = static_cast<double>(piece) / kAsinhPieces;
    const double scalar = axis.scalarAt(x);
    definition.colours.push_back({scalar, colours.at(x)});
    definition.opacities.push_back({scalar, curve.at(x)});
  }
  return definition;
}

TransferFunction FunctionParts::function() const {
  return TransferFunction(definition(), nullptr, opacity_unit);
}

std::vector<OpacityPoint> parseOpacities(std::string_view option, std::string_view text) {
  std::vector<OpacityPoint> points;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view pair = text.substr(begin, end - begin);
    const size_t colon = pair.find(':');
    const auto x = parseUnit(pair.substr(0, colon));
    const auto opacity = colon == std::string_view::npos ? std::nullopt : parseUnit(pair.substr(colon + 1));
    if (!x || !opacity)
      throw UsageError(
          "{} {}: '{}' is not POSITION:OPACITY with numbers from 0 to 1; expected a list such as "
          "0.2:0,0.5:0.8,1:0.1",
          option, text, pair);
    if (!points.empty() && *x < points.back().x)
      throw UsageError("{} {}: position {} follows {}; positions must not decrease", option, text, *x,
                       points.back().x);
    points.push_back({*x, *opacity});
    begin = end + 1;
  }
  if (points.size() < 2)
    throw UsageError("{} {}: expected two or more points, such as 0:0,1:0.5", option, text);
  if (points.front().x > 0) points.insert(points.begin(), {0, points.front().opacity});
  if (points.back().x < 1) points.push_back({1, points.back().opacity});
  return points;
}

std::string textOf(const std::vector<OpacityPoint>& opacities) {
  std::string text;
  for (const OpacityPoint& point : opacities)
    text += fmt::format("{}{}:{}", text.empty() ? "" : ",", point.x, point.opacity);
  return text;
}

nlohmann::ordered_json jsonOf(const FunctionParts& parts) {
  nlohmann::ordered_json json = {{"map", parts.map}, {"range", {parts.range.first, parts.range.second}}};
  if (parts.asinh) json["asinh"] = {parts.asinh->centre, parts.asinh->width};
  if (!parts.opacities.empty()) json["opacities"] = textOf(parts.opacities);
  json["opacity_unit"] = parts.opacity_unit;
  return json;
}

std::vector<OpacityPoint> opacitiesFrom(const JsonField& field) {
  try {
    return parseOpacities("", field.text());
  } catch (const UsageError&) {
    field.fail("opacities such as 0:0,0.5:0.8,1:1");
  }
}

namespace {

std::pair<double, double> pairFrom(const JsonField& field) {
  const std::vector<JsonField> both = field.elements(2);
  if (both.size() != 2) field.fail("two numbers");
  return {both[0].number(-1e300, 1e300), both[1].number(-1e300, 1e300)};
}

}  // namespace

FunctionParts functionPartsFrom(const JsonField& fields) {
  FunctionParts parts{fields.at("map").text(), pairFrom(fields.at("range")), {}, {}, 1};
  if (!(parts.range.first < parts.range.second)) fields.at("range").fail("an increasing range");
  if (const auto asinh = fields.find("asinh")) {
    const auto [centre, width] = pairFrom(*asinh);
    if (!(width > 0)) asinh->fail("a width above zero");
    parts.asinh = AsinhScale{centre, width};
  }
  if (const auto opacities = fields.find("opacities")) parts.opacities = opacitiesFrom(*opacities);
  parts.opacity_unit = fields.at("opacity_unit").number(1e-300, 1e300);
  return parts;
}

double roundedTo(double value, double scale, int digits) {
  if (!(scale > 0) || !std::isfinite(value)) return value;
  const int last =
      static_cast<int>(std::floor(std::log10(scale))) - digits + 1;  // exponent of the last digit
  const double magnitude = std::abs(value);
  if (magnitude < 0.5 * std::pow(10, last)) return 0;
  const int own = static_cast<int>(std::floor(std::log10(magnitude)));
  const std::string text = fmt::format("{:.{}e}", value, std::clamp(own - last, 0, 17));
  double result = value;
  std::from_chars(text.data(), text.data() + text.size(), result);
  return result;
}

}  // namespace curvisplat
