// Reads ParaView's colour-map presets: a list of JSON objects, or one, with these fields:
//
//   Name            text
//   RGBPoints       x r g b, x r g b, ...
//   Points          x opacity midpoint sharpness, ...                  optional
//   ColorSpace      RGB, HSV, HSVNoWrap, Lab, Diverging, Step          optional: RGB; HSVWrap: false as well
//   UseLogScale     0, 1, true or false; LogScale is the same          optional
//   NanColor        r g b                                              optional
//   ScalarOpacityUnitDistance   world units                            optional
//
// Other fields are ignored, except that those which would change the picture in ParaView are reported.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "render/colour/transfer_function.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"

namespace curvisplat {
namespace {

using Json = nlohmann::json;

/// A list of numbers, `tuple` for each point; one point or more.
std::vector<double> tuplesOf(const JsonField& list, size_t tuple, std::string_view form) {
  std::vector<double> values = list.numbers();
  if (values.empty() || values.size() % tuple != 0)
    list.fail(fmt::format("{} numbers a point ({}), not {} in all", tuple, form, values.size()));
  return values;
}

/// 0, 1, true or false.
bool flagIn(const JsonField& preset, const char* name, bool otherwise) {
  const auto field = preset.find(name);
  if (!field) return otherwise;
  const Json& value = field->json();
  if (value != true && value != false && value != 0 && value != 1) field->fail("0, 1, true or false");
  return value == true || value == 1;
}

void checkUnit(const JsonField& field, std::string_view what) {
  if (const double value = field.number(); !(value >= 0 && value <= 1))
    field.fail(fmt::format("{} between 0 and 1", what));
}

/// Sorts by x, as ParaView does; points with equal x keep the file's order.
template <typename Point>
void sortPoints(std::vector<Point>& points, const JsonField& list) {
  std::stable_sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.x < b.x; });
  if (!(points.front().x < points.back().x)) list.fail("points at two or more different scalars");
}

std::vector<ColourPoint> readColours(const JsonField& list) {
  const auto numbers = tuplesOf(list, 4, "x, red, green, blue");
  std::vector<ColourPoint> points;
  for (size_t n = 0; n < numbers.size(); n += 4) {
    for (size_t c = 1; c < 4; ++c) checkUnit(list[n + c], "colours");
    points.push_back({numbers[n], {numbers[n + 1], numbers[n + 2], numbers[n + 3]}});
  }
  sortPoints(points, list);
  return points;
}

std::vector<OpacityPoint> readOpacities(const JsonField& list) {
  const auto numbers = tuplesOf(list, 4, "x, opacity, midpoint, sharpness");
  std::vector<OpacityPoint> points;
  for (size_t n = 0; n < numbers.size(); n += 4) {
    checkUnit(list[n + 1], "opacities");
    checkUnit(list[n + 2], "midpoints");
    checkUnit(list[n + 3], "sharpnesses");
    points.push_back({numbers[n], numbers[n + 1], numbers[n + 2], numbers[n + 3]});
  }
  sortPoints(points, list);
  return points;
}

const char* nameOf(ColourSpace space) {
  switch (space) {
    case ColourSpace::kHsv:
      return "HSV";
    case ColourSpace::kHsvNoWrap:
      return "HSVNoWrap";
    case ColourSpace::kLab:
      return "Lab";
    case ColourSpace::kDiverging:
      return "Diverging";
    case ColourSpace::kStep:
      return "Step";
    case ColourSpace::kRgb:
      break;
  }
  return "RGB";
}

ColourSpace readColourSpace(const JsonField& preset) {
  const auto field = preset.find("ColorSpace");
  if (!field) return ColourSpace::kRgb;
  const std::pair<const char*, ColourSpace> known[] = {
      {"RGB", ColourSpace::kRgb},
      {"HSV", flagIn(preset, "HSVWrap", true) ? ColourSpace::kHsv : ColourSpace::kHsvNoWrap},
      {"HSVNoWrap", ColourSpace::kHsvNoWrap},
      {"Lab", ColourSpace::kLab},
      {"Diverging", ColourSpace::kDiverging},
      {"Step", ColourSpace::kStep}};
  for (const auto& [name, space] : known)
    if (field->json() == name) return space;
  field->fail("RGB, HSV, HSVNoWrap, Lab, Diverging or Step");
}

void refuseCategories(const JsonField& preset) {
  const auto categories = preset.find("IndexedColors");
  if (categories && (!preset.has("RGBPoints") || flagIn(preset, "IndexedLookup", false)))
    categories->fail(
        "a continuous colour map, RGBPoints; categories have no order along a scalar: choose another preset");
}

}  // namespace

TransferFunctionDefinition readParaViewPreset(const std::filesystem::path& path) {
  return parseParaViewPreset(readTextFile(path), path);
}

TransferFunctionDefinition parseParaViewPreset(const std::string& text, const std::filesystem::path& path) {
  const JsonDocument document(text, path.string(), "a colour-map preset of ParaView's");
  const JsonField root = document.root();
  if (root.isArray() && root.size() == 0) root.fail("a colour-map preset");
  const JsonField preset = root.isArray() ? root[0] : root;
  if (!preset.isObject()) preset.fail("a colour-map preset, an object or a list of them");
  refuseCategories(preset);

  TransferFunctionDefinition definition;
  const auto name = preset.find("Name");
  definition.name = oneLine(name ? name->text() : path.stem().string());
  definition.origin = fmt::format("{}: preset '{}'", path.string(), definition.name);
  definition.colour_space = readColourSpace(preset);
  definition.colours = readColours(preset.at("RGBPoints"));
  definition.log_scale = flagIn(preset, "UseLogScale", false) || flagIn(preset, "LogScale", false);
  const auto note = [&](std::string words) {
    definition.notes.push_back(fmt::format("{}: {}", path.string(), words));
  };
  if (root.isArray() && root.size() > 1)
    note(fmt::format("holds {} presets; the first, '{}', is used", root.size(), definition.name));
  if (const auto points = preset.find("Points"))
    definition.opacities = readOpacities(*points);
  else
    note("no Points in the file: the default opacity ramp is used");
  if (const auto colour = preset.find("NanColor")) {
    const glm::dvec3 rgb = colour->point();
    for (size_t channel = 0; channel < 3; ++channel) checkUnit((*colour)[channel], "colours");
    definition.nan_colour = {rgb.x, rgb.y, rgb.z};
    note("NanColor is not used: a cache does not contain samples that are NaN");
  }
  if (const auto unit = preset.find("ScalarOpacityUnitDistance")) {
    definition.opacity_unit = unit->number();
    if (!(definition.opacity_unit > 0)) unit->fail("a length above zero");
  }
  if (flagIn(preset, "UseBelowRangeColor", false) || flagIn(preset, "UseAboveRangeColor", false))
    note("colours below and above the range are not used; the colours at its ends continue");
  return definition;
}

std::string toParaViewPreset(const TransferFunctionDefinition& definition) {
  nlohmann::ordered_json preset = {{"Name", definition.name},
                                   {"ColorSpace", nameOf(definition.colour_space)},
                                   {"UseLogScale", definition.log_scale ? 1 : 0}};
  if (definition.opacity_unit > 0) preset["ScalarOpacityUnitDistance"] = definition.opacity_unit;
  auto& colours = preset["RGBPoints"] = nlohmann::ordered_json::array();
  for (const ColourPoint& point : definition.colours)
    for (const double number : {point.x, point.rgb.x, point.rgb.y, point.rgb.z}) colours.push_back(number);
  if (!definition.opacities.empty()) {
    auto& opacities = preset["Points"] = nlohmann::ordered_json::array();
    for (const OpacityPoint& point : definition.opacities)
      for (const double number : {point.x, point.opacity, point.midpoint, point.sharpness})
        opacities.push_back(number);
  }
  return nlohmann::ordered_json::array({preset}).dump(1) + "\n";
}

}  // namespace curvisplat
