#include "tools/options/further_scalars.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <set>
#include <string_view>
#include <system_error>

#include "preprocess/addition/add_scalar.h"
#include "stream/base/error.h"
#include "stream/base/shell_word.h"
#include "stream/cache/cache_reader.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/series_scalar.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

ConvertArguments argumentsFor(const std::vector<fs::path>& files, const fs::path& cache) {
  ConvertArguments arguments;
  arguments.grid.grid = files.front();
  arguments.grid.solutions.assign(files.begin() + 1, files.end());
  arguments.to = cache;
  return arguments;
}

/// Computed from the nodes without a solution; few look for these.
bool isOfGridAlone(const std::string& name) {
  constexpr std::array<std::string_view, 5> kNames{"i", "j", "k", "jacobian", "volume"};
  return std::ranges::find(kNames, name) != kNames.end();
}

bool isSeries(const CacheReader& cache) {
  return cache.series().steps.size() > 1;
}

Centring centringOf(const CacheReader& cache) {
  return cache.manifest().cells ? Centring::kCell : Centring::kNode;
}

/// What the files have; of a series, its first step.
std::vector<GridScalar> scalarsIn(const std::vector<fs::path>& files, const CacheReader& cache) {
  ConvertArguments arguments = argumentsFor(files, cache.path());
  if (isSeries(cache)) arguments.grid = stepsOfFiles(files).front().options;
  return openSource(arguments, cache.path())->description().scalars;
}

std::vector<FurtherScalar> furtherAmong(const std::vector<GridScalar>& scalars, const CacheReader& cache) {
  std::set<std::string> names;
  for (const VariableInfo& variable : cache.manifest().variables) names.insert(variable.name);
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

std::vector<fs::path> sourcesOf(const Manifest& manifest, const fs::path& cache) {
  std::vector<fs::path> files;
  std::error_code ignored;
  for (const std::string& source : manifest.sources) {
    const fs::path given = source, beside = fs::absolute(cache).parent_path() / given.filename();
    const fs::path found = fs::exists(given, ignored) ? given : beside;
    if (!fs::exists(found, ignored)) return {};
    files.push_back(fs::absolute(found));
  }
  return files;
}

std::vector<FurtherScalar> furtherScalarsOf(const fs::path& cache, const std::vector<fs::path>& files) {
  const CacheReader reader(cache);
  return furtherAmong(scalarsIn(files, reader), reader);
}

void addFurtherScalar(const fs::path& cache, const std::vector<fs::path>& files, const std::string& name,
                      Progress& progress) {
  if (isSeries(CacheReader(cache))) return addScalarToSeries(cache, files, name, progress);
  ConvertArguments arguments = argumentsFor(files, cache);
  arguments.added_scalars = {name};
  const auto source = openSource(arguments, cache);
  AddScalarOptions options;
  options.cache = cache;
  options.scalars = chooseScalars(arguments, arguments.added_scalars, source->description());
  try {
    addScalars(*source, options, progress);
  } catch (const UsageError& error) {
    throw Error("{}", error.what());
  }
}

void addMissingScalars(const fs::path& cache, const std::vector<fs::path>& files,
                       const std::vector<std::string>& names, Progress& progress) {
  std::set<std::string> missing(names.begin(), names.end());
  missing.erase("");
  const CacheReader reader(cache);
  for (const VariableInfo& variable : reader.manifest().variables) missing.erase(variable.name);
  if (missing.empty()) return;
  const std::vector<GridScalar> scalars = scalarsIn(files, reader);
  for (const GridScalar& scalar : scalars)  // as `info` prints it
    if (!scalar.unit.empty() && missing.erase(fmt::format("{} [{}]", scalar.name, scalar.unit)) > 0)
      missing.insert(scalar.name);
  for (const VariableInfo& variable : reader.manifest().variables) missing.erase(variable.name);
  for (const FurtherScalar& one : furtherAmong(scalars, reader))
    if (missing.erase(one.name) > 0) addFurtherScalar(cache, files, one.name, progress);
  for (const std::string& name : missing) requireSameCentring(name, scalars, reader, files);
}

}  // namespace curvisplat
