#include "stream/cache/manifest.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <span>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/json_text.h"
#include "stream/cache/cache_format.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint64_t kOldestVersion = 1, kFirstWithRequirements = 2, kNewestVersion = 2;
constexpr const char* kKnownFeatures[] = {kBorderFaces, kCellGrowth, kMergedBorders, kSteps};
constexpr const char* kFormat = "curvisplat splat cache";
// 100,000 blocks take half of this. Parsed JSON takes about twenty times the size of its text.
constexpr size_t kLargestText = 16 << 20;
// Squares and cubes of lengths up to this are finite, and so are sums of positions.
constexpr double kLargestCoordinate = 1e100;
constexpr uint64_t kLargestVariableNumber = 0x7fffffff;
constexpr const char* kChecksum = "checksum";
// Names of files and blocks may be in any encoding, but JSON is UTF-8: invalid bytes are replaced.
constexpr auto kReplace = Json::error_handler_t::replace;

/// The checksum of a manifest whose `checksum` has been removed. It does not depend on white space.
std::string checksumText(const Json& json) {
  const std::string text = json.dump(-1, ' ', false, kReplace);
  return fmt::format("{:016x}", checksumOf(std::as_bytes(std::span(text))));
}

Json jsonOf(const glm::dvec3& v) {
  return Json::array({v.x, v.y, v.z});
}

// ---- reading: every field is checked for presence, type and range ----

/// A JSON object of the manifest: access to its fields, and errors that name the field.
class Fields {
 public:
  Fields(const Json& json, std::string place, const std::filesystem::path& path)
      : json_(json), place_(std::move(place)), path_(path) {
    if (!json.is_object()) fail("", "an object", json);
  }

  std::string text(const char* name) const {
    const Json& value = at(name);
    if (!value.is_string()) fail(name, "a string", value);
    return oneLine(value.get<std::string>());
  }

  double number(const char* name) const { return numberOf(at(name), name); }

  uint64_t count(const char* name, uint64_t lowest, uint64_t highest) const {
    return countOf(at(name), name, lowest, highest);
  }

  glm::dvec3 point(const char* name) const {
    const Json& value = at(name);
    if (!value.is_array() || value.size() != 3) fail(name, "three numbers", value);
    const glm::dvec3 point(numberOf(value[0], name), numberOf(value[1], name), numberOf(value[2], name));
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(point[axis]) > kLargestCoordinate)
        fail(name, fmt::format("three numbers of magnitude up to {}", kLargestCoordinate), value);
    return point;
  }

  /// Checksums are strings of 16 hexadecimal digits, because many JSON readers convert numbers to doubles.
  uint64_t checksum(const char* name) const {
    const std::string digits = text(name);
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
    if (digits.size() != 16 || error != std::errc() || end != digits.data() + digits.size())
      fail(name, "16 hexadecimal digits", at(name));
    return value;
  }

  /// The name of a file of the cache. It must be a plain name, which cannot lead out of the cache's folder.
  std::string fileName(const char* name) const {
    const std::string file = text(name);
    const bool plain = !file.empty() && file != "." && file != ".." && file.find('/') == std::string::npos;
    if (!plain) fail(name, "a plain file name", at(name));
    return file;
  }

  template <typename Each>
  void eachObject(const char* name, Each each) const {
    const Json& value = array(name);
    for (size_t n = 0; n < value.size(); ++n)
      each(Fields(value[n], fmt::format("{}{}[{}].", place_, name, n), path_));
  }

  std::vector<std::string> texts(const char* name) const {
    std::vector<std::string> out;
    for (const Json& value : array(name)) {
      if (!value.is_string()) fail(name, "an array of strings", value);
      out.push_back(oneLine(value.get<std::string>()));
    }
    return out;
  }

  std::vector<uint32_t> numbers(const char* name) const {
    std::vector<uint32_t> out;
    for (const Json& value : array(name))
      out.push_back(static_cast<uint32_t>(countOf(value, name, 0, std::numeric_limits<uint32_t>::max())));
    return out;
  }

  Fields object(const char* name) const { return {at(name), place_ + name + ".", path_}; }

  [[noreturn]] void fail(const std::string& name, const std::string& expected, const Json& found) const {
    std::string shown = found.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (shown.size() > 60) shown = shown.substr(0, 60) + "...";
    throw Error("{}: '{}{}' is invalid (found {}, expected {}); the file is damaged or another program's",
                path_.string(), place_, name, shown, expected);
  }

 private:
  const Json& at(const char* name) const {
    const auto found = json_.find(name);
    if (found == json_.end())
      throw Error("{}: '{}{}' is missing; the file is damaged or another program's", path_.string(), place_,
                  name);
    return *found;
  }

  const Json& array(const char* name) const {
    const Json& value = at(name);
    if (!value.is_array()) fail(name, "an array", value);
    return value;
  }

  double numberOf(const Json& value, const char* name) const {
    if (!value.is_number() || !std::isfinite(value.get<double>())) fail(name, "a finite number", value);
    return value.get<double>();
  }

  uint64_t countOf(const Json& value, const char* name, uint64_t lowest, uint64_t highest) const {
    if (!value.is_number_unsigned() || value.get<uint64_t>() < lowest || value.get<uint64_t>() > highest)
      fail(name, fmt::format("a whole number from {} to {}", lowest, highest), value);
    return value.get<uint64_t>();
  }

  const Json& json_;
  std::string place_;
  const std::filesystem::path& path_;
};

constexpr uint64_t kAny = std::numeric_limits<uint64_t>::max();

template <typename T>
bool allDifferent(std::vector<T> values) {
  std::sort(values.begin(), values.end());
  return std::adjacent_find(values.begin(), values.end()) == values.end();
}

void readRoot(const Fields& fields, Manifest& manifest, const Json& json) {
  const Fields root = fields.object("root");
  manifest.root.min = root.point("min");
  manifest.root.size = root.number("size");
  if (!(manifest.root.size > 0 && manifest.root.size <= kLargestCoordinate))
    root.fail("size", fmt::format("a number above 0, up to {}", kLargestCoordinate), json["root"]["size"]);
  manifest.lower = fields.point("lower");
  manifest.upper = fields.point("upper");
  for (int axis = 0; axis < 3; ++axis)
    if (manifest.lower[axis] > manifest.upper[axis]) fields.fail("lower", "at most 'upper'", json["lower"]);
}

/// Whether the samples are cells.
bool readCentring(const Fields& fields, const Json& json) {
  if (!json.contains("centring")) return false;
  const std::string centring = fields.text("centring");
  if (centring != "node" && centring != "cell")
    fields.fail("centring", "\"node\" or \"cell\"", json["centring"]);
  return centring == "cell";
}

void readVariables(const Fields& fields, Manifest& manifest, const Json& json) {
  std::vector<uint32_t> numbers;
  std::vector<std::string> names;
  fields.eachObject("variables", [&](const Fields& entry) {
    VariableInfo variable;
    variable.number = static_cast<uint32_t>(entry.count("number", 0, kLargestVariableNumber));
    variable.name = entry.text("name");
    variable.unit = entry.text("unit");
    variable.min = entry.number("min");
    variable.max = entry.number("max");
    constexpr double kLargest = std::numeric_limits<float>::max();  // splats store values as floats
    if (!(variable.min >= -kLargest && variable.min <= variable.max && variable.max <= kLargest))
      entry.fail("min", "at most 'max', and both in the range of a float", variable.min);
    numbers.push_back(variable.number);
    names.push_back(variable.name);
    manifest.variables.push_back(std::move(variable));
  });
  if (!allDifferent(numbers) || !allDifferent(names))
    fields.fail("variables", "variables with distinct numbers and names", json["variables"]);
}

void readSteps(const Fields& fields, Manifest& manifest, const Json& json) {
  fields.eachObject("steps", [&](const Fields& entry) {
    StepInfo step;
    step.time = entry.number("time");
    step.geometry = entry.fileName("geometry");
    step.variables = entry.numbers("variables");
    for (uint32_t number : step.variables) {
      const bool known = std::any_of(manifest.variables.begin(), manifest.variables.end(),
                                     [&](const VariableInfo& v) { return v.number == number; });
      if (!known) entry.fail("variables", "numbers of listed variables", json["steps"]);
    }
    manifest.steps.push_back(std::move(step));
  });
  if (manifest.steps.empty()) fields.fail("steps", "at least one step", json["steps"]);
}

void readFiles(const Fields& fields, Manifest& manifest, const Json& json) {
  std::vector<std::string> names;
  fields.eachObject("files", [&](const Fields& entry) {
    manifest.files.push_back(
        {entry.fileName("name"), entry.count("size", 0, kAny), entry.checksum("checksum")});
    names.push_back(manifest.files.back().name);
  });
  if (!allDifferent(names)) fields.fail("files", "files with distinct names", json["files"]);
}

}  // namespace

bool Manifest::hasFeature(const char* feature) const {
  return std::find(requirements.begin(), requirements.end(), feature) != requirements.end();
}

std::string Manifest::toJson() const {
  Json json;
  json["format"] = kFormat;
  json["version"] = requirements.empty() ? kOldestVersion : kNewestVersion;
  if (!requirements.empty()) json["requires"] = requirements;
  json["title"] = title;
  json["program"] = program;
  json["sources"] = sources;
  json["reader"] = reader;
  json["root"] = {{"min", jsonOf(root.min)}, {"size", root.size}};
  json["lower"] = jsonOf(lower);
  json["upper"] = jsonOf(upper);
  json["blocks"] = Json::array();
  for (const BlockInfo& block : blocks)
    json["blocks"].push_back({{"name", block.name}, {"ni", block.ni}, {"nj", block.nj}, {"nk", block.nk}});
  if (cells) json["centring"] = "cell";
  json["nodes"] = nodes;
  json["blanked_nodes"] = blanked_nodes;
  json["splats"] = splats;
  json["bricks"] = bricks;
  json["levels"] = levels;
  json["volume"] = volume;
  if (grid_checksum) json["grid_checksum"] = fmt::format("{:016x}", *grid_checksum);
  if (!time_unit.empty()) json["time_unit"] = time_unit;
  if (!calendar.empty()) json["calendar"] = calendar;
  json["variables"] = Json::array();
  for (const VariableInfo& variable : variables)
    json["variables"].push_back({{"number", variable.number},
                                 {"name", variable.name},
                                 {"unit", variable.unit},
                                 {"min", variable.min},
                                 {"max", variable.max}});
  json["steps"] = Json::array();
  for (const StepInfo& step : steps)
    json["steps"].push_back(
        {{"time", step.time}, {"geometry", step.geometry}, {"variables", step.variables}});
  json["files"] = Json::array();
  for (const FileInfo& file : files)
    json["files"].push_back(
        {{"name", file.name}, {"size", file.size}, {"checksum", fmt::format("{:016x}", file.checksum)}});
  json[kChecksum] = checksumText(json);
  return json.dump(2, ' ', false, kReplace) + "\n";
}

Manifest Manifest::fromJson(const std::string& text, const std::filesystem::path& path) {
  if (text.size() > kLargestText)
    throw Error(
        "{}: is too large for a manifest (found {} bytes, expected at most {}); the file is damaged: convert "
        "again",
        path.string(), text.size(), kLargestText);
  requireShallowJson(text, path.string());
  Json json;
  try {
    json = Json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    throw Error("{}: is not valid JSON: found {}; the file is damaged or another program's", path.string(),
                jsonFault(text, error));
  }
  const Fields fields(json, "", path);
  if (fields.text("format") != kFormat) fields.fail("format", fmt::format("'{}'", kFormat), json["format"]);
  const uint64_t version = fields.count("version", 0, kAny);
  if (version > kNewestVersion)
    throw OtherVersion(
        "{}: the cache has format version {}; this program reads versions up to {}: use a newer program",
        path.string(), version, kNewestVersion);
  if (version < kOldestVersion)
    throw OtherVersion(
        "{}: the cache has the experimental format version {}; this program reads versions from {} on: "
        "convert again, with --overwrite",
        path.string(), version, kOldestVersion);
  if (json.contains(kChecksum)) {  // the earliest caches have none
    const std::string stated = fields.text(kChecksum);
    json.erase(kChecksum);
    const std::string found = checksumText(json);
    if (found != stated)
      throw Error(
          "{}: has a wrong checksum (found {}, expected {}); the file is damaged or was edited: "
          "convert again",
          path.string(), found, stated);
  }
  Manifest manifest;
  if (version >= kFirstWithRequirements) manifest.requirements = fields.texts("requires");
  for (const std::string& feature : manifest.requirements)
    if (std::find(std::begin(kKnownFeatures), std::end(kKnownFeatures), feature) == std::end(kKnownFeatures))
      throw OtherVersion(
          "{}: the cache requires the feature '{}', which this program does not know; use a newer "
          "program",
          path.string(), feature);
  manifest.title = fields.text("title");
  manifest.program = fields.text("program");
  manifest.sources = fields.texts("sources");
  manifest.reader = fields.text("reader");
  readRoot(fields, manifest, json);
  fields.eachObject("blocks", [&](const Fields& block) {
    manifest.blocks.push_back({block.text("name"), block.count("ni", 1, kAny), block.count("nj", 1, kAny),
                               block.count("nk", 1, kAny)});
  });
  manifest.cells = readCentring(fields, json);
  manifest.nodes = fields.count("nodes", 0, kAny);
  manifest.blanked_nodes = fields.count("blanked_nodes", 0, manifest.nodes);
  manifest.splats = fields.count("splats", 1, kAny);
  manifest.bricks = fields.count("bricks", 1, 0x7fffffff);
  manifest.levels = static_cast<uint32_t>(fields.count("levels", 1, kMaxLevel + 1));
  manifest.volume = fields.number("volume");
  if (manifest.volume < 0) fields.fail("volume", "0 or more", json["volume"]);
  if (json.contains("grid_checksum")) manifest.grid_checksum = fields.checksum("grid_checksum");
  if (json.contains("time_unit")) manifest.time_unit = fields.text("time_unit");
  if (json.contains("calendar")) manifest.calendar = fields.text("calendar");
  readVariables(fields, manifest, json);
  readSteps(fields, manifest, json);
  readFiles(fields, manifest, json);
  return manifest;
}

}  // namespace curvisplat
