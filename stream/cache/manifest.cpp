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
#include "stream/base/json_document.h"
#include "stream/cache/cache_format.h"
#include "stream/codec/values_codec.h"
#include "stream/model/thin_walls.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint64_t kOldestVersion = 1, kFirstWithRequirements = 2, kNewestVersion = 2;
constexpr const char* kKnownFeatures[] = {
    kBorderFaces, kCellGrowth,   kMergedBorders, kFaceLayers, kPlates,           kBorderPairs, kSteps,
    kFineValues,  kScaledValues, kCellOctants,   kOwnBlanks,  kOwnBlanksOfSteps, kThinWalls};
constexpr const char* kFormat = "curvisplat splat cache";
// 100,000 blocks take half of this. Parsed JSON takes about twenty times the size of its text.
constexpr size_t kLargestText = 16 << 20;
// Squares and cubes of lengths up to this are finite, and so are sums of positions.
constexpr double kLargestCoordinate = 1e100;
constexpr uint64_t kLargestVariableNumber = 0x7fffffff, kLargestRefinement = 0xffff;
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

constexpr const char* kGlobeShapes[] = {"sphere", "map", "lengths"};  // in the order of Globe::Shape

Json jsonOf(const Globe& globe) {
  return {{"shape", kGlobeShapes[static_cast<size_t>(globe.shape)]},
          {"radius", globe.radius_km},
          {"vertical_scale", globe.vertical_scale},
          {"middle_longitude", globe.middle_longitude}};
}

Globe globeIn(const JsonField& field) {
  Globe globe;
  const JsonField shape = field.at("shape"), radius = field.at("radius");
  const auto* const found = std::find(std::begin(kGlobeShapes), std::end(kGlobeShapes), shape.text());
  if (found == std::end(kGlobeShapes)) shape.fail("\"sphere\", \"map\" or \"lengths\"");
  globe.shape = static_cast<Globe::Shape>(found - std::begin(kGlobeShapes));
  globe.radius_km = radius.number();
  if (!(globe.radius_km > 0 && globe.radius_km <= kLargestCoordinate))
    radius.fail(fmt::format("a number above 0, up to {}", kLargestCoordinate));
  globe.vertical_scale = field.at("vertical_scale").number();
  globe.middle_longitude = field.at("middle_longitude").number();
  return globe;
}

/// Checksums are strings of 16 hexadecimal digits, because many JSON readers convert numbers to doubles.
uint64_t checksumIn(const JsonField& field) {
  const std::string digits = field.text();
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  if (digits.size() != 16 || error != std::errc() || end != digits.data() + digits.size())
    field.fail("16 hexadecimal digits");
  return value;
}

/// The name of a file of the cache. It must be a plain name, which cannot lead out of the cache's folder.
std::string fileName(const JsonField& field) {
  const std::string file = oneLine(field.text());
  if (file.empty() || file == "." || file == ".." || file.find('/') != std::string::npos)
    field.fail("a plain file name");
  return file;
}

std::string lineOf(const JsonField& field) {
  return oneLine(field.text());
}

std::vector<std::string> linesOf(const JsonField& field) {
  std::vector<std::string> lines = field.texts();
  for (std::string& line : lines) line = oneLine(line);
  return lines;
}

template <typename T>
bool allDifferent(std::vector<T> values) {
  std::sort(values.begin(), values.end());
  return std::adjacent_find(values.begin(), values.end()) == values.end();
}

void readRoot(const JsonField& fields, Manifest& manifest) {
  const JsonField root = fields.at("root"), size = root.at("size");
  manifest.root.min = root.at("min").point(kLargestCoordinate);
  manifest.root.size = size.number();
  if (!(manifest.root.size > 0 && manifest.root.size <= kLargestCoordinate))
    size.fail(fmt::format("a number above 0, up to {}", kLargestCoordinate));
  manifest.lower = fields.at("lower").point(kLargestCoordinate);
  manifest.upper = fields.at("upper").point(kLargestCoordinate);
  for (int axis = 0; axis < 3; ++axis)
    if (manifest.lower[axis] > manifest.upper[axis]) fields.at("lower").fail("at most 'upper'");
}

uint32_t partsIn(const JsonField& field) {
  return static_cast<uint32_t>(field.count(1, kLargestRefinement));
}

void readBlocks(const JsonField& fields, Manifest& manifest) {
  std::vector<CellCuts> of_blocks;
  bool any = false;
  for (const JsonField& block : fields.at("blocks").elements()) {
    manifest.blocks.push_back({lineOf(block.at("name")), block.at("ni").count(1), block.at("nj").count(1),
                               block.at("nk").count(1)});
    CellCuts& parts = of_blocks.emplace_back(kWholeCells);
    const auto refined = block.find("refined");
    if (!refined) continue;
    any = true;
    const std::vector<JsonField> axes = refined->elements();
    if (axes.size() != parts.size()) refined->fail("three integers");
    std::transform(axes.begin(), axes.end(), parts.begin(), partsIn);
  }
  if (const auto refined = fields.find("refined"))
    manifest.refinement = Refinement(partsIn(*refined));
  else if (any)
    manifest.refinement = Refinement(std::move(of_blocks));
}

/// Whether the samples are cells.
bool readCentring(const JsonField& fields) {
  const auto centring = fields.find("centring");
  if (!centring) return false;
  const std::string text = centring->text();
  if (text != "node" && text != "cell") centring->fail("\"node\" or \"cell\"");
  return text == "cell";
}

void readVariables(const JsonField& list, Manifest& manifest) {
  std::vector<uint32_t> numbers;
  std::vector<std::string> names;
  for (const JsonField& entry : list.elements()) {
    VariableInfo variable;
    variable.number = static_cast<uint32_t>(entry.at("number").count(0, kLargestVariableNumber));
    variable.name = lineOf(entry.at("name"));
    variable.unit = lineOf(entry.at("unit"));
    variable.min = entry.at("min").number();
    variable.max = entry.at("max").number();
    constexpr double kLargest = std::numeric_limits<float>::max();  // splats store values as floats
    if (!(variable.min >= -kLargest && variable.min <= variable.max && variable.max <= kLargest))
      entry.at("min").fail("at most 'max', and both in the range of a float");
    numbers.push_back(variable.number);
    names.push_back(variable.name);
    manifest.variables.push_back(std::move(variable));
  }
  if (!allDifferent(numbers) || !allDifferent(names)) list.fail("variables with distinct numbers and names");
}

void readSteps(const JsonField& list, Manifest& manifest) {
  for (const JsonField& entry : list.elements()) {
    StepInfo step;
    step.time = entry.at("time").number();
    step.geometry = fileName(entry.at("geometry"));
    for (const JsonField& field : entry.at("variables").elements()) {
      const auto number = static_cast<uint32_t>(field.count(0, kLargestVariableNumber));
      const bool known = std::any_of(manifest.variables.begin(), manifest.variables.end(),
                                     [&](const VariableInfo& v) { return v.number == number; });
      if (!known) field.fail("the number of a listed variable");
      step.variables.push_back(number);
    }
    manifest.steps.push_back(std::move(step));
  }
  if (manifest.steps.empty()) list.fail("at least one step");
}

void readOwnBlanks(const JsonField& list, Manifest& manifest) {
  if (!manifest.hasFeature(kOwnBlanks)) list.fail("absent without the feature 'own-blanks'");
  std::vector<std::string> names;
  for (const VariableInfo& variable : manifest.variables) names.push_back(variable.name);
  for (const JsonField& entry : list.elements()) {
    manifest.own_blanks.push_back({linesOf(entry.at("variables")), checksumIn(entry.at("checksum"))});
    const std::vector<std::string>& of_set = manifest.own_blanks.back().variables;
    if (of_set.empty()) entry.at("variables").fail("at least one name");
    names.insert(names.end(), of_set.begin(), of_set.end());
  }
  if (!allDifferent(names)) list.fail("names that are distinct, and not those of the cache's own variables");
}

void readFiles(const JsonField& list, Manifest& manifest) {
  std::vector<std::string> names;
  for (const JsonField& entry : list.elements()) {
    manifest.files.push_back(
        {fileName(entry.at("name")), entry.at("size").count(), checksumIn(entry.at("checksum"))});
    names.push_back(manifest.files.back().name);
  }
  if (!allDifferent(names)) list.fail("files with distinct names");
}

/// The earliest caches have no checksum.
void checkOwnChecksum(JsonDocument& document, const std::filesystem::path& path) {
  if (!document.root().has(kChecksum)) return;
  const std::string stated = document.root().at(kChecksum).text();
  document.json().erase(kChecksum);
  const std::string found = checksumText(document.json());
  if (found != stated)
    throw Error(
        "{}: has a wrong checksum (found {}, expected {}); the file is damaged or was edited: convert again",
        path.string(), found, stated);
}

void checkVersion(uint64_t version, const std::filesystem::path& path) {
  if (version > kNewestVersion)
    throw OtherVersion(
        "{}: the cache has format version {}; this program reads versions up to {}: use a newer program",
        path.string(), version, kNewestVersion);
  if (version < kOldestVersion)
    throw OtherVersion(
        "{}: the cache has the experimental format version {}; this program reads versions from {} on: "
        "convert again, with --overwrite",
        path.string(), version, kOldestVersion);
}

/// The element of a list that has the name, or null.
template <class Element>
const Element* elementNamed(const std::vector<Element>& list, std::string_view name) {
  const auto found = std::ranges::find(list, name, &Element::name);
  return found == list.end() ? nullptr : &*found;
}

}  // namespace

bool Manifest::isMesh() const {
  return blocks.size() == 1 && blocks[0].nj == 1 && blocks[0].name == (cells ? "cells" : "points");
}

const VariableInfo* Manifest::variable(std::string_view name) const {
  return elementNamed(variables, name);
}

const FileInfo* Manifest::file(std::string_view name) const {
  return elementNamed(files, name);
}

bool Manifest::hasFeature(const char* feature) const {
  return std::find(requirements.begin(), requirements.end(), feature) != requirements.end();
}

ValuePrecision precisionOf(const Manifest& manifest) {
  if (manifest.hasFeature(kFineValues)) return ValuePrecision::kFine;
  return manifest.hasFeature(kScaledValues) ? ValuePrecision::kAuto : ValuePrecision::kNormal;
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
  for (size_t n = 0; n < blocks.size(); ++n) {
    const BlockInfo& block = blocks[n];
    json["blocks"].push_back({{"name", block.name}, {"ni", block.ni}, {"nj", block.nj}, {"nk", block.nk}});
    const CellCuts& parts = refinement.ofBlock(n);
    if (!refinement.isUniform() && parts != kWholeCells) json["blocks"].back()["refined"] = parts;
  }
  if (cells) json["centring"] = "cell";
  if (refinement.isUniform() && refinement.cutsCells()) json["refined"] = refinement.parts();
  json["nodes"] = nodes;
  json["blanked_nodes"] = blanked_nodes;
  json["splats"] = splats;
  json["bricks"] = bricks;
  json["levels"] = levels;
  json["volume"] = volume;
  if (!overlap.empty()) json["overlap"] = overlap;
  if (!stretch.empty()) json["stretch"] = stretch;
  if (grid_checksum) json["grid_checksum"] = fmt::format("{:016x}", *grid_checksum);
  if (!time_unit.empty()) json["time_unit"] = time_unit;
  if (!calendar.empty()) json["calendar"] = calendar;
  if (globe) json["globe"] = jsonOf(*globe);
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
  for (const OwnBlanks& set : own_blanks)
    json["own_blanks"].push_back(
        {{"variables", set.variables}, {"checksum", fmt::format("{:016x}", set.checksum)}});
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
  JsonDocument document(text, path.string(), "the manifest of a cache",
                        "the file is damaged or was written by another program: convert again");
  {
    const JsonField format = document.root().at("format");
    if (format.text() != kFormat) format.fail(fmt::format("\"{}\"", kFormat));
  }
  const uint64_t version = document.root().at("version").count();
  checkVersion(version, path);
  checkOwnChecksum(document, path);
  const JsonField fields = document.root();
  Manifest manifest;
  if (version >= kFirstWithRequirements) manifest.requirements = linesOf(fields.at("requires"));
  for (const std::string& feature : manifest.requirements)
    if (std::find(std::begin(kKnownFeatures), std::end(kKnownFeatures), feature) == std::end(kKnownFeatures))
      throw OtherVersion(
          "{}: the cache requires the feature '{}', which this program does not know; use a newer "
          "program",
          path.string(), feature);
  manifest.title = lineOf(fields.at("title"));
  manifest.program = lineOf(fields.at("program"));
  manifest.sources = linesOf(fields.at("sources"));
  manifest.reader = lineOf(fields.at("reader"));
  readRoot(fields, manifest);
  readBlocks(fields, manifest);
  manifest.cells = readCentring(fields);
  manifest.nodes = fields.at("nodes").count();
  manifest.blanked_nodes = fields.at("blanked_nodes").count(0, manifest.nodes);
  manifest.splats = fields.at("splats").count(1);
  manifest.bricks = fields.at("bricks").count(1, 0x7fffffff);
  manifest.levels = static_cast<uint32_t>(fields.at("levels").count(1, kMaxLevel + 1));
  manifest.volume = fields.at("volume").number();
  if (manifest.volume < 0) fields.at("volume").fail("0 or more");
  if (const auto overlap = fields.find("overlap")) manifest.overlap = lineOf(*overlap);
  if (const auto stretch = fields.find("stretch")) manifest.stretch = lineOf(*stretch);
  if (const auto checksum = fields.find("grid_checksum")) manifest.grid_checksum = checksumIn(*checksum);
  if (const auto unit = fields.find("time_unit")) manifest.time_unit = lineOf(*unit);
  if (const auto calendar = fields.find("calendar")) manifest.calendar = lineOf(*calendar);
  if (const auto globe = fields.find("globe")) manifest.globe = globeIn(*globe);
  readVariables(fields.at("variables"), manifest);
  readSteps(fields.at("steps"), manifest);
  if (const auto own = fields.find("own_blanks")) readOwnBlanks(*own, manifest);
  readFiles(fields.at("files"), manifest);
  return manifest;
}

}  // namespace curvisplat
