#include "tools/serve/served_caches.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "render/colour/transfer_function.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/cache/probe.h"
#include "stream/cache/value_histogram.h"
#include "tools/view/edited_function.h"
#include "tools/view/first_view.h"
#include "tools/view/picture_layout.h"
#include "tools/view/saved_views.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr ImageSize kFirstSize{1200, 800};
constexpr size_t kBins = 128;
constexpr int kStripColours = 128, kSwatchColours = 16;

std::string textOf(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// Colours along a function's range, as "rrggbb...".
std::string stripOf(const EditedFunction& function, int colours = kStripColours) {
  std::string strip;
  for (int n = 0; n < colours; ++n) {
    const glm::dvec3 colour = 255.0 * function.colourAt(n / (colours - 1.0)) + 0.5;
    strip += fmt::format("{:02x}{:02x}{:02x}", static_cast<int>(colour.r), static_cast<int>(colour.g),
                         static_cast<int>(colour.b));
  }
  return strip;
}

void addFunction(Json& json, const EditedFunction& function) {
  json["preset"] = function.preset();
  json["function"] = Json::parse(toParaViewPreset(function.definition())).front();
  const auto parts = function.parts();
  json["parts"] = parts ? jsonOf(*parts) : Json(nullptr);
  json["strip"] = stripOf(function);
}

Json jsonOf(const glm::dvec3& point) {
  return {point.x, point.y, point.z};
}

std::string nameOf(const fs::path& path) {
  const fs::path folder = path.has_filename() ? path : path.parent_path();
  return folder.stem().string();
}

size_t variableOf(const CacheReader& reader, const std::string& name, const std::string& scalar) {
  const auto& variables = reader.manifest().variables;
  for (size_t n = 0; n < variables.size(); ++n)
    if (variables[n].name == scalar) return n;
  throw UsageError("{} has no scalar '{}'", name, scalar);
}

}  // namespace

ServedFolders::ServedFolders(const std::vector<fs::path>& paths, FacesOf faces) : faces_(std::move(faces)) {
  for (const fs::path& path : paths) {
    const std::string name = nameOf(path);
    const auto same = std::ranges::count(folders_, name, [](const Folder& one) { return nameOf(one.path); });
    folders_.push_back({path, same > 0 ? fmt::format("{} ({})", name, same + 1) : name, {}, {}});
    open(folders_.back());
  }
}

void ServedFolders::open(Folder& folder) const {
  // Before it is read: it may change meanwhile.
  const FileState manifest = FileState::of(folder.path / "manifest.json");
  ServedCaches::All caches;
  const auto add = [&](const std::string& name, CacheReader reader) {
    ViewState first = firstViewOf(reader, "", kFirstSize);
    std::vector<std::string> faces;
    if (faces_) try {
        faces = faces_(reader);
      } catch (const Error& error) {
        printMessage("warning: {}: its faces cannot be shown: {}", name, error.what());
      }
    caches.push_back(std::make_shared<ServedCache>(
        ServedCache{name, std::move(reader), std::move(first), std::move(faces)}));
  };
  const CacheReader reader(folder.path);
  add(folder.name, reader.at(reader.position()));
  const std::vector<OwnBlanks>& sets = reader.seriesManifest().own_blanks;
  for (size_t n = 0; n < sets.size(); ++n)
    add(fmt::format("{}: {}", folder.name, listed(sets[n].variables)), reader.ownBlanks(n));
  folder.manifest = manifest;
  folder.caches = std::move(caches);
}

std::shared_ptr<const ServedCaches> ServedFolders::caches() {
  const MutexLock lock(opening_);
  ServedCaches::All all;
  for (Folder& folder : folders_) {
    if (folder.manifest != FileState::of(folder.path / "manifest.json")) try {
        const MutexLock reading(reading_);
        open(folder);
      } catch (const std::exception& error) {
        printMessage("warning: {}; viewers are shown the cache as it was before", error.what());
      }
    all.insert(all.end(), folder.caches.begin(), folder.caches.end());
  }
  return std::make_shared<const ServedCaches>(std::move(all), reading_);
}

const ServedCache& ServedCaches::at(size_t cache) const {
  if (cache >= caches_.size())
    throw UsageError("there is no cache {}; the last one is {}", cache, caches_.size() - 1);
  return *caches_[cache];
}

/// The width of the data's part of a picture to its height, in the first view.
double ServedCaches::aspectOf(size_t cache, ImageSize picture) const {
  const ServedCache& served = at(cache);
  const ImageSize data = dataSizeOf(served.first, served.reader.manifest(), picture);
  return static_cast<double>(data.width) / data.height;
}

/// The camera was chosen for the usual shape of a window; in a narrower one it is further away, and sees as much of the
/// data's width.
ViewState ServedCaches::firstView(size_t cache, ImageSize size) const {
  ViewState state = at(cache).first;
  const double narrower = std::max(1.0, aspectOf(cache, kFirstSize) / aspectOf(cache, size));
  Camera& camera = state.camera;
  camera.parallel_scale *= narrower;
  camera.position = camera.focal_point + narrower * (camera.position - camera.focal_point);
  return state;
}

std::string ServedCaches::helloText() const {
  Json json = {{"type", "hello"}, {"program", "curvisplat " CURVISPLAT_VERSION}};
  json["caches"] = Json::array();
  for (const auto& cache : caches_) json["caches"].push_back(cache->name);
  json["maps"] = Json::array();
  for (const PublishedMap& map : builtInMaps()) {
    const EditedFunction function(std::string(map.name), 0, 1, 1);
    json["maps"].push_back({{"name", map.name}, {"strip", stripOf(function, kSwatchColours)}});
  }
  json["most_pixels"] = kMaxPixels;
  json["largest_side"] = kLargestSide;
  return textOf(json);
}

std::string ServedCaches::cacheText(const OpenRequest& request) const {
  const ServedCache& cache = at(request.cache);
  const Manifest& manifest = cache.reader.manifest();
  Json json = {{"type", "cache"}, {"cache", request.cache}, {"name", cache.name}};
  json["lower"] = jsonOf(manifest.lower);
  json["upper"] = jsonOf(manifest.upper);
  json["globe"] = nullptr;
  if (manifest.globe)
    json["globe"] = {{"sphere", manifest.globe->sphere()},
                     {"degrees", manifest.globe->degrees()},
                     {"radius", manifest.globe->radius_km},
                     {"vertical_scale", manifest.globe->vertical_scale}};
  json["samples"] = manifest.nodes;
  json["scalars"] = Json::array();
  for (const VariableInfo& variable : manifest.variables)
    json["scalars"].push_back({{"name", variable.name},
                               {"title", scalarTitle(variable.name, variable.unit)},
                               {"low", variable.min},
                               {"high", variable.max}});
  json["faces"] = cache.faces;
  json["times"] = Json::array();
  for (const SeriesStep& step : cache.reader.series().steps) json["times"].push_back(step.time);
  json["time_unit"] = cache.reader.seriesManifest().time_unit;
  json["shape"] = aspectOf(request.cache, kFirstSize);
  const ViewState state = firstView(request.cache, request.size);
  json["state"] = Json::parse(toJson(state));
  json["strip"] = stripOf(state.function);
  return textOf(json);
}

std::string ServedCaches::functionText(const FunctionRequest& request) const {
  const ServedCache& cache = at(request.cache);
  variableOf(cache.reader, cache.name, request.scalar);
  const MutexLock lock(reading_);
  Json json = {{"type", "function"}, {"cache", request.cache}, {"scalar", request.scalar}};
  EditedFunction function = automaticFunction(cache.reader, request.scalar, request.with_sheets);
  function.suitBackground(request.dark);
  addFunction(json, function);
  return textOf(json);
}

std::string ServedCaches::histogramText(const HistogramRequest& request) const {
  const ServedCache& cache = at(request.cache);
  const size_t variable = variableOf(cache.reader, cache.name, request.scalar);
  const MutexLock lock(reading_);
  Json json = {{"type", "histogram"}, {"cache", request.cache}, {"scalar", request.scalar},
               {"low", request.low},  {"high", request.high},   {"log", request.log}};
  EditedFunction function(
      FunctionParts{.range = {request.low, request.high}, .asinh = request.asinh, .opacities = {}});
  function.setLogScale(request.log);
  json["asinh"] = request.asinh ? Json{request.asinh->centre, request.asinh->width} : Json(nullptr);
  json["bins"] = histogramOf(cache.reader, variable, function, kBins);
  json["percentiles"] = nullptr;  // of 1 and 99 % of the volume
  if (const auto stored = stepHistogram(cache.reader, variable))
    json["percentiles"] = {stored->percentile(0.01), stored->percentile(0.99)};
  return textOf(json);
}

std::string ServedCaches::finerText(uint64_t number, const AskedStep& asked) const {
  const MutexLock lock(reading_);
  const CacheReader reader = at(asked.cache).reader.atStep(asked.step);
  return textOf(
      {{"type", "finer"}, {"number", number}, {"texts", finerThanStored(reader, asked.differences)}});
}

std::string ServedCaches::markerText(size_t cache_number, const MarkedScalar& scalar,
                                     const std::optional<glm::dvec3>& point) const {
  const ServedCache& cache = at(cache_number);
  const size_t variable = variableOf(cache.reader, cache.name, scalar.name);
  const MutexLock lock(reading_);
  const CacheReader reader = cache.reader.atStep(scalar.step);
  const auto found = point ? probe(reader, {&variable, 1}, *point) : std::nullopt;
  const char* const type = scalar.hovers ? "value" : "marker";
  if (!found)
    return textOf(
        {{"type", type}, {"cache", cache_number}, {"x", scalar.x}, {"y", scalar.y}, {"marker", nullptr}});
  // As ViewState's JSON has markers, without a name.
  const Json marker = {{"point", jsonOf(*point)},
                       {"scalar", scalar.name},
                       {"unit", reader.manifest().variables[variable].unit},
                       {"value", found->variables.at(0).value},
                       {"block", found->block},
                       {"i", found->i},
                       {"j", found->j},
                       {"k", found->k}};
  return textOf(
      {{"type", type}, {"cache", cache_number}, {"x", scalar.x}, {"y", scalar.y}, {"marker", marker}});
}

std::string ServedCaches::coloursText(const ColoursRequest& request) {
  Json json = {{"type", "colours"}, {"map", request.map}};
  EditedFunction function(request.map, 0, 1, 1);
  if (request.parts) {
    function = EditedFunction(*request.parts);
    function.setColours(request.map);
  }
  addFunction(json, function);
  return textOf(json);
}

std::string ServedCaches::isosurfaceText(const IsosurfaceRequest& request) const {
  const ServedCache& cache = at(request.cache);
  const CacheReader& reader = cache.reader;
  variableOf(reader, cache.name, request.scalar);
  if (request.step >= reader.series().steps.size()) throw UsageError("there is no step {}", request.step);
  const ViewState state = [&] {
    try {
      return viewStateFromJson(request.state, "view", reader.manifest());
    } catch (const Error& error) {
      throw UsageError("{}", error.what());  // the viewer's fault, which the server does not report
    }
  }();
  const MutexLock lock(reading_);
  const double value = firstIsovalue(reader.atStep(request.step), state, request.scalar);
  return textOf(
      {{"type", "isosurface"}, {"cache", request.cache}, {"scalar", request.scalar}, {"value", value}});
}

std::string ServedCaches::commandText(const CommandRequest& request) const {
  const CacheReader& reader = at(request.cache).reader;
  const uint64_t steps = reader.series().steps.size();
  if (request.step >= steps)
    throw UsageError("there is no step {}; the last one is {}", request.step, steps - 1);
  ViewState state = viewStateFromJson(request.state, "view", reader.manifest());
  state.surfaces.clear();  // they name files
  fs::path folder = reader.wholePath();
  if (!folder.has_filename()) folder = folder.parent_path();
  CommandOptions options{folder.filename(), request.size, {}, {}};
  Json files = Json::array();
  const auto keep = [&](const EditedFunction& function, const char* what, fs::path& file) {
    if (!needsFile(function)) return;
    file = fmt::format("{}_{}.json", folder.stem().string(), what);
    files.push_back({{"name", file.string()}, {"text", toParaViewPreset(function.definition())}});
  };
  keep(state.function, "colours", options.function_file);
  if (state.opacity_by) keep(state.opacity_by->function, "opacities", options.opacity_file);
  std::string text = renderCommand(state, options);
  if (steps > 1) text += fmt::format(" --step {}", request.step);
  return textOf({{"type", "command"}, {"cache", request.cache}, {"text", text}, {"files", files}});
}

std::string ServedCaches::refusalText(const std::string& text, bool reduced) {
  Json message{{"type", "error"}, {"text", text}};
  if (reduced) message["reduced"] = true;
  return textOf(message);
}

std::string ServedCaches::errorText(std::string text) const {
  const auto replaceAll = [&](const std::string& from, const std::string& to) {
    for (size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
      text.replace(at, from.size(), to);
  };
  for (const auto& cache : caches_)
    for (const fs::path& path : {cache->reader.path(), cache->reader.cachePath()})
      replaceAll(path.string(), cache->name);
  replaceAll("give --backend", "have the server started with --backend");  // a viewer has no options
  replaceAll("open it again", "reload this page");
  return refusalText(text);
}

}  // namespace curvisplat
