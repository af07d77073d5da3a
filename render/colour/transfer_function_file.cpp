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
#include "stream/base/json_text.h"

namespace curvisplat {
namespace {

using Json = nlohmann::json;

/// The JSON object of one preset, with its place for messages.
class PresetObject {
 public:
  PresetObject(const std::filesystem::path& path, const Json& object) : path_(path), object_(object) {
    if (!object.is_object())
      throw Error("{}: expected a colour-map preset (a JSON object, or a list of them), found {}",
                  path.string(), kind(object));
    name_ = path.stem().string();
    if (const Json* name = find("Name")) {
      if (!name->is_string()) fail("Name", "a string", kind(*name));
      name_ = name->get<std::string>();
      for (char& c : name_)
        if (static_cast<unsigned char>(c) < ' ') c = ' ';  // messages are one line
    }
  }

  const std::string& name() const { return name_; }
  std::string origin() const { return fmt::format("{}: preset '{}'", path_.string(), name_); }

  const Json* find(const char* field) const {
    const auto found = object_.find(field);
    return found == object_.end() ? nullptr : &*found;
  }

  [[noreturn]] void fail(const char* field, std::string_view expected, std::string_view found) const {
    throw Error("{}, field {}: expected {}, found {}", origin(), field, expected, found);
  }

  /// A list of numbers, `tuple` for each point; one point or more.
  std::vector<double> numbers(const char* field, size_t tuple, std::string_view form) const {
    const Json* list = find(field);
    if (!list) fail(field, fmt::format("a list of numbers, {} a point", form), "no such field");
    if (!list->is_array()) fail(field, fmt::format("a list of numbers, {} a point", form), kind(*list));
    std::vector<double> values;
    for (const Json& value : *list) {
      if (!value.is_number())
        fail(field, "numbers alone", fmt::format("{} at position {}", kind(value), values.size()));
      values.push_back(value.get<double>());
    }
    if (values.empty() || values.size() % tuple != 0)
      fail(field, fmt::format("{} numbers a point ({})", tuple, form),
           fmt::format("{} numbers", values.size()));
    return values;
  }

  /// 0, 1, true or false.
  bool flag(const char* field, bool otherwise) const {
    const Json* value = find(field);
    if (!value) return otherwise;
    if (value->is_boolean()) return value->get<bool>();
    if (value->is_number() && (*value == 0 || *value == 1)) return *value == 1;
    fail(field, "0, 1, true or false", kind(*value));
  }

  void checkUnit(const char* field, double value, std::string_view what) const {
    if (!(value >= 0 && value <= 1))
      fail(field, fmt::format("{} between 0 and 1", what), fmt::format("{}", value));
  }

  /// `value`, or its type, in short.
  static std::string kind(const Json& value) {
    if (value.is_structured()) return fmt::format("a JSON {}", value.type_name());
    return value.dump().substr(0, 60);
  }

 private:
  const std::filesystem::path& path_;
  const Json& object_;
  std::string name_;
};

/// Sorts by x, as ParaView does; points with equal x keep the file's order.
template <typename Point>
void sortPoints(std::vector<Point>& points, const PresetObject& preset, const char* field) {
  std::stable_sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.x < b.x; });
  if (!(points.front().x < points.back().x))
    preset.fail(field, "points at two or more different scalars",
                fmt::format("{} at {}", points.size(), points.front().x));
}

std::vector<ColourPoint> readColours(const PresetObject& preset) {
  const auto numbers = preset.numbers("RGBPoints", 4, "x, red, green, blue");
  std::vector<ColourPoint> points;
  for (size_t n = 0; n < numbers.size(); n += 4) {
    for (size_t c = 1; c < 4; ++c) preset.checkUnit("RGBPoints", numbers[n + c], "colours");
    points.push_back({numbers[n], {numbers[n + 1], numbers[n + 2], numbers[n + 3]}});
  }
  sortPoints(points, preset, "RGBPoints");
  return points;
}

std::vector<OpacityPoint> readOpacities(const PresetObject& preset) {
  const auto numbers = preset.numbers("Points", 4, "x, opacity, midpoint, sharpness");
  std::vector<OpacityPoint> points;
  for (size_t n = 0; n < numbers.size(); n += 4) {
    preset.checkUnit("Points", numbers[n + 1], "opacities");
    preset.checkUnit("Points", numbers[n + 2], "midpoints");
    preset.checkUnit("Points", numbers[n + 3], "sharpnesses");
    points.push_back({numbers[n], numbers[n + 1], numbers[n + 2], numbers[n + 3]});
  }
  sortPoints(points, preset, "Points");
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

ColourSpace readColourSpace(const PresetObject& preset) {
  const Json* field = preset.find("ColorSpace");
  if (!field) return ColourSpace::kRgb;
  const std::pair<const char*, ColourSpace> known[] = {
      {"RGB", ColourSpace::kRgb},
      {"HSV", preset.flag("HSVWrap", true) ? ColourSpace::kHsv : ColourSpace::kHsvNoWrap},
      {"HSVNoWrap", ColourSpace::kHsvNoWrap},
      {"Lab", ColourSpace::kLab},
      {"Diverging", ColourSpace::kDiverging},
      {"Step", ColourSpace::kStep}};
  for (const auto& [name, space] : known)
    if (*field == name) return space;
  preset.fail("ColorSpace", "RGB, HSV, HSVNoWrap, Lab, Diverging or Step", PresetObject::kind(*field));
}

void refuseCategories(const PresetObject& preset) {
  const bool no_points = !preset.find("RGBPoints");
  if (preset.find("IndexedColors") && (no_points || preset.flag("IndexedLookup", false)))
    preset.fail("IndexedColors", "a continuous colour map (RGBPoints)",
                "a map of categories, which have no order along a scalar; choose another preset");
}

Json parse(const std::string& text, const std::filesystem::path& path) {
  requireShallowJson(text, path.string());
  try {
    return Json::parse(text);
  } catch (const Json::exception& error) {
    throw Error("{}: expected a ParaView colour-map preset in JSON, found {}", path.string(),
                jsonFault(text, error));
  }
}

}  // namespace

TransferFunctionDefinition readParaViewPreset(const std::filesystem::path& path) {
  return parseParaViewPreset(readTextFile(path), path);
}

TransferFunctionDefinition parseParaViewPreset(const std::string& text, const std::filesystem::path& path) {
  const Json file = parse(text, path);
  if (file.is_array() && file.empty())
    throw Error("{}: expected a colour-map preset, found an empty list", path.string());
  const PresetObject preset(path, file.is_array() ? file.front() : file);
  refuseCategories(preset);

  TransferFunctionDefinition definition;
  definition.name = preset.name();
  definition.origin = preset.origin();
  definition.colour_space = readColourSpace(preset);
  definition.colours = readColours(preset);
  definition.log_scale = preset.flag("UseLogScale", false) || preset.flag("LogScale", false);
  const auto note = [&](std::string words) {
    definition.notes.push_back(fmt::format("{}: {}", path.string(), words));
  };
  if (file.is_array() && file.size() > 1)
    note(fmt::format("holds {} presets; the first, '{}', is used", file.size(), preset.name()));
  if (preset.find("Points"))
    definition.opacities = readOpacities(preset);
  else
    note("no Points in the file: the default opacity ramp is used");
  if (preset.find("NanColor")) {
    const auto rgb = preset.numbers("NanColor", 3, "red, green, blue");
    if (rgb.size() != 3) preset.fail("NanColor", "3 numbers", fmt::format("{}", rgb.size()));
    for (const double channel : rgb) preset.checkUnit("NanColor", channel, "colours");
    definition.nan_colour = {rgb[0], rgb[1], rgb[2]};
    note("NanColor is not used: a cache does not contain samples that are NaN");
  }
  if (const Json* unit = preset.find("ScalarOpacityUnitDistance")) {
    if (!unit->is_number() || !(unit->get<double>() > 0))
      preset.fail("ScalarOpacityUnitDistance", "a length above zero", PresetObject::kind(*unit));
    definition.opacity_unit = unit->get<double>();
  }
  if (preset.flag("UseBelowRangeColor", false) || preset.flag("UseAboveRangeColor", false))
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
