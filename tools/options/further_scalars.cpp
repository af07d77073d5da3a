#include "tools/options/further_scalars.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/addition/convert_series.h"
#include "preprocess/addition/value_passes.h"
#include "preprocess/convert/convert.h"
#include "preprocess/formats/open/series_files.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/faces_file.h"
#include "stream/model/thin_walls.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/kept_conversion.h"
#include "tools/options/point_values.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// The options that converted the cache, as far as it records them.
SeriesOptions optionsLike(const CacheReader& cache, const fs::path& output) {
  SeriesOptions options;
  options.convert.output = output;
  options.convert.temporary_folder = output.parent_path();
  options.convert.title = cache.seriesManifest().title;
  options.convert.surfaces = FacesReader::open(cache.path(), cache.manifest()) != nullptr;
  options.convert.planes = planesOf(cache);
  options.convert.blank_faces = hasFacesOfBlanks(cache);
  options.convert.precision = precisionOf(cache.manifest());
  if (cache.manifest().overlap == kOverlapAll) options.convert.overlap = Overlap::kAll;
  return options;
}

/// Whether two steps agree in all that other options would have changed.
bool isSameStep(const Manifest& a, const Manifest& b) {
  // Earlier programs merged the sides of thin walls.
  const bool has_same_splats = a.splats == b.splats || a.hasFeature(kThinWalls) != b.hasFeature(kThinWalls);
  return a.nodes == b.nodes && a.blanked_nodes == b.blanked_nodes && has_same_splats && a.cells == b.cells &&
         a.lower == b.lower && a.upper == b.upper;
}

[[noreturn]] void refuse(const CacheReader& cache, const std::string& name) {
  throw Error(
      "{}: these files and the default options of convert make another series; convert it again with "
      "--scalar all, or with its own options and {}",
      cache.cachePath().string(), name);
}

void exchange(const fs::path& a, const fs::path& b) {
  if (SystemCalls::current().exchange(a.c_str(), b.c_str()) < 0)
    throw Error("{}: cannot be replaced: {}", b.string(), std::generic_category().message(errno));
  syncDirectory(b.parent_path());
}

/// The time steps that `files` make, the grid first; patterns may be among them. Throws Error.
std::vector<StepFiles> stepsOfFiles(const std::vector<fs::path>& files) {
  OpenGridOptions options;
  options.grid = files.front();
  options.solutions.assign(files.begin() + 1, files.end());
  expandPatterns(options);
  return stepsOf(options);
}

/// Converts all steps of `files` again, with the scalars that the cache has and `name`, in a folder beside
/// the cache, which the new one then replaces. Takes the time and the space of converting the series. Throws
/// Error as converting does, and if the cache was made from other files or with options of `convert` that it
/// does not record, and Interrupted once `progress` is stopped; then the cache is as it was.
void addScalarToSeries(const fs::path& cache, const std::vector<fs::path>& files, const std::string& name,
                       Progress& progress) {
  const fs::path whole = fs::canonical(cache);  // that of a kept series is a link
  const CacheLock lock(whole);
  const CacheReader before(whole);
  const std::vector<StepFiles> steps = stepsOfFiles(files);
  if (steps.size() != before.series().steps.size())
    throw Error("{}: has {} steps, but its files have {}; convert the series again with --scalar {}",
                cache.string(), before.series().steps.size(), steps.size(), name);
  ConvertArguments arguments;
  for (const VariableInfo& variable : before.seriesManifest().variables)
    arguments.scalars.push_back(variable.name);
  arguments.scalars.push_back(name);
  arguments.refinement = before.seriesManifest().refinement;

  const std::string folder_name = whole.filename().string() + ".adding";
  PreviewFolder::removeLeftOnes(whole.parent_path(), folder_name);
  const PreviewFolder folder(whole.parent_path(), folder_name);  // in the end, of the old one
  arguments.output = folder.path() / whole.filename();
  const SeriesOptions options = optionsLike(before, arguments.output);
  convertSeries(seriesInput(arguments, steps, steps), options, progress, [&](const SeriesEvent& event) {
    if (event.converted && !isSameStep(CacheReader(arguments.output).manifest(), before.manifest()))
      refuse(before, name);
  });
  const auto same_time = [](const SeriesStep& a, const SeriesStep& b) {
    return a.time == b.time && a.geometry == b.geometry;
  };
  if (!std::ranges::equal(CacheReader(arguments.output).series().steps, before.series().steps, same_time))
    refuse(before, name);
  lock.requireStillThere();
  exchange(arguments.output, whole);
}

ConvertArguments argumentsFor(const std::vector<fs::path>& files, const fs::path& cache) {
  ConvertArguments arguments;
  arguments.grid.grid = files.front();
  arguments.grid.solutions.assign(files.begin() + 1, files.end());
  arguments.to = cache;
  return arguments;
}

/// Whether `after` has the values of `before`, as far as ranges and times tell.
bool hasSameValues(const Manifest& after, const Manifest& before) {
  const auto is_in = [&](const VariableInfo& one) {
    const VariableInfo* const same = after.variable(one.name);
    return same && same->min == one.min && same->max == one.max;
  };
  return isSameStep(after, before) && after.steps.front().time == before.steps.front().time &&
         std::ranges::all_of(before.variables, is_in);
}

/// Converts the files again with the scalars that the cache has and `name`, which not all its samples have, as addScalarToSeries() does.
void convertAgainWith(const fs::path& cache, const std::vector<fs::path>& files, const std::string& name,
                      Progress& progress) {
  const fs::path whole = fs::canonical(cache);
  const CacheLock lock(whole);
  const CacheReader before(whole);
  ConvertArguments arguments = argumentsFor(files, {});
  arguments.scalars = before.allScalars();
  arguments.scalars.push_back(name);
  arguments.refinement = before.manifest().refinement;
  const std::string folder_name = whole.filename().string() + ".adding";
  PreviewFolder::removeLeftOnes(whole.parent_path(), folder_name);
  const PreviewFolder folder(whole.parent_path(), folder_name);  // in the end, of the old one
  arguments.output = folder.path() / whole.filename();
  ConvertOptions options = optionsLike(before, arguments.output).convert;
  const auto source =
      openStepOf(before.manifest(), arguments.grid, [&] { return openSource(arguments, arguments.output); });
  options.scalars = chooseScalars(arguments, arguments.scalars, source->description());
  options.differing = DifferingScalars::kKeepApart;
  const ConvertReport report = convert(*source, options, progress);
  if (!hasSameValues(CacheReader(arguments.output).manifest(), before.manifest()))
    throw Error(
        "{}: these files and the default options of convert make another cache; convert it again with {}",
        whole.string(), name);
  lock.requireStillThere();
  exchange(arguments.output, whole);
  for (const auto* warnings : {&source->description().warnings, &report.warnings})
    for (const std::string& warning : *warnings) printMessage("warning: {}", warning);
  for (const std::string& note : report.notes) printMessage("note: {}", note);
}

/// Computed from the nodes without a solution; few look for these.
bool isOfGridAlone(const std::string& name) {
  constexpr std::array<std::string_view, 5> kNames{"i", "j", "k", "jacobian", "volume"};
  return std::ranges::find(kNames, name) != kNames.end();
}

bool hasSeveralSteps(const CacheReader& cache) {
  return cache.series().steps.size() > 1;
}

Centring centringOf(const CacheReader& cache) {
  return cache.manifest().cells ? Centring::kCell : Centring::kNode;
}

/// The scalars that the files have; of a series, those of its first step.
std::vector<GridScalar> scalarsIn(const std::vector<fs::path>& files, const CacheReader& cache) {
  ConvertArguments arguments = argumentsFor(files, cache.path());
  if (hasSeveralSteps(cache)) arguments.grid = stepsOfFiles(files).front().options;
  return openSource(arguments, cache.path())->description().scalars;
}

std::vector<FurtherScalar> furtherAmong(const std::vector<GridScalar>& scalars, const CacheReader& cache) {
  const std::vector<std::string> present = cache.allScalars();
  std::set<std::string> names(present.begin(), present.end());
  std::vector<FurtherScalar> further;
  for (const GridScalar& scalar : scalars)
    if (scalar.centring == centringOf(cache) && names.insert(scalar.name).second)
      further.push_back({scalar.name, scalar.unit, scalar.derived});
  std::stable_partition(further.begin(), further.end(),
                        [](const FurtherScalar& one) { return !one.derived || !isOfGridAlone(one.name); });
  return further;
}

/// Throws Error if the files have the scalar, but not at the samples of the cache.
void requireSameCentring(const std::string& name, const std::vector<GridScalar>& scalars,
                         const CacheReader& cache, const std::vector<fs::path>& files) {
  for (const GridScalar& scalar : scalars) {
    if (scalar.name != name || scalar.centring == centringOf(cache)) continue;
    std::string words;
    for (const fs::path& file : files) words += shellWord(file.string()) + ' ';
    const bool cells = scalar.centring == Centring::kCell;
    throw Error(
        "{}: {} is {}-centred, and the cache that is kept of the grid holds its {}-centred scalars; "
        "convert it to another one: curvisplat convert {}-o NAME.splats {}",
        files.front().string(), name, cells ? "cell" : "node", cells ? "node" : "cell", words,
        shellOption("--scalar", name));
  }
}

}  // namespace

std::vector<FurtherScalar> furtherScalarsOf(const fs::path& cache, const std::vector<fs::path>& files) {
  const CacheReader reader(cache);
  return furtherAmong(scalarsIn(files, reader), reader);
}

void addFurtherScalar(const fs::path& cache, const std::vector<fs::path>& files, const std::string& name,
                      Progress& progress) {
  if (hasSeveralSteps(CacheReader(cache))) return addScalarToSeries(cache, files, name, progress);
  ConvertArguments arguments = argumentsFor(files, cache);
  arguments.added_scalars = {name};
  const auto source =
      openStepOf(CacheReader(cache).manifest(), arguments.grid, [&] { return openSource(arguments, cache); });
  AddScalarOptions options;
  options.cache = cache;
  options.scalars = chooseScalars(arguments, arguments.added_scalars, source->description());
  try {
    for (const std::string& warning : addScalars(*source, options, progress).warnings)
      printMessage("warning: {}", warning);
  } catch (const LacksValues&) {
    convertAgainWith(cache, files, name, progress);
  } catch (const UsageError& error) {
    throw Error("{}", error.what());
  }
}

void addMissingScalars(const fs::path& cache, const std::vector<fs::path>& files,
                       const std::vector<std::string>& names, Progress& progress) {
  std::set<std::string> missing(names.begin(), names.end());
  missing.erase("");
  const CacheReader reader(cache);
  const std::vector<std::string> present = reader.allScalars();
  for (const std::string& name : present) missing.erase(name);
  if (missing.empty()) return;
  const std::vector<GridScalar> scalars = scalarsIn(files, reader);
  for (const GridScalar& scalar : scalars)  // as `info` prints it
    if (!scalar.unit.empty() && missing.erase(fmt::format("{} [{}]", scalar.name, scalar.unit)) > 0)
      missing.insert(scalar.name);
  for (const std::string& name : present) missing.erase(name);
  for (const FurtherScalar& one : furtherAmong(scalars, reader))
    if (missing.erase(one.name) > 0) addFurtherScalar(cache, files, one.name, progress);
  for (const std::string& name : missing) requireSameCentring(name, scalars, reader, files);
}

}  // namespace curvisplat
