#include "stream/cache/geometry_folder.h"

#include <string>
#include <system_error>
#include <vector>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/suggestion.h"
#include "stream/cache/cache_file.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/partial_folder.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// The paths of the caches in the folder of one that is missing, as that is written.
std::vector<std::string> cachesBeside(const fs::path& cache) {
  constexpr size_t kMax = 1000;
  std::vector<std::string> caches;
  std::error_code error;
  const fs::path folder = cache.parent_path();
  for (fs::directory_iterator at(folder.empty() ? "." : folder, error), end;
       !error && at != end && caches.size() < kMax; at.increment(error))
    if (at->path().extension() == ".splats") caches.push_back((folder / at->path().filename()).string());
  return caches;
}

}  // namespace

Manifest readManifest(const fs::path& cache) {
  if (!fs::exists(cache)) {
    if (hasUnfinished(cache))
      throw Error("{}: its conversion is unfinished; repeat the convert command with --resume to continue it",
                  cache.string());
    throw Error(
        "{}: does not exist{}; expected a splat cache (convert the grid first: curvisplat convert GRID -o "
        "{})",
        cache.string(), didYouMean(cache.string(), cachesBeside(cache)), cache.string());
  }
  if (!fs::is_directory(cache))
    throw Error(
        "{}: is not a directory; expected a splat cache (convert the grid first: curvisplat convert GRID -o "
        "NAME.splats)",
        cache.string());
  if (!fs::exists(cache / "manifest.json"))
    throw Error("{}: contains no manifest.json; it is not a splat cache, or its conversion is unfinished",
                cache.string());
  const fs::path path = cacheFile(cache, "manifest.json");
  return Manifest::fromJson(readTextFile(path), path);
}

GeometryFolder::GeometryFolder(fs::path folder, Manifest manifest)
    : path_(std::move(folder)),
      manifest_(std::move(manifest)),
      bricks_(readBricks(path_, manifest_)),
      geometry_(cacheFile(path_, manifest_.steps.front().geometry)) {
  checkFile(geometry_, manifest_);
}

std::shared_ptr<const GeometryFolder> GeometryFolder::open(const fs::path& cache, const Manifest& manifest,
                                                           const Series& series, uint32_t geometry) {
  if (geometry == 0) return std::make_shared<GeometryFolder>(cache, manifest);
  const fs::path folder = cacheFolder(cache, geometryFolderName(geometry));
  const fs::path path = cacheFile(folder, "manifest.json");
  const std::string text = readTextFile(path);
  const uint64_t expected = series.steps[series.first_steps[geometry]].geometry_checksum;
  const uint64_t found = checksumOf(std::as_bytes(std::span(text)));
  if (found != expected)
    throw Error(
        "{}: has a wrong checksum (found {:016x}, expected {:016x}); the cache is damaged: convert again",
        path.string(), found, expected);
  Manifest of_folder = Manifest::fromJson(text, path);
  bool fits = !of_folder.hasFeature(kSteps) && of_folder.variables.size() == manifest.variables.size();
  for (size_t v = 0; fits && v < manifest.variables.size(); ++v)
    fits = of_folder.variables[v].number == manifest.variables[v].number &&
           of_folder.variables[v].name == manifest.variables[v].name;
  if (!fits)
    throw Error(
        "{}: has other scalars than the series that it belongs to; the cache is damaged: convert again",
        path.string());
  return std::make_shared<GeometryFolder>(folder, std::move(of_folder));
}

std::shared_ptr<const ValuesFile> GeometryFolder::values(const Series& series, uint64_t step,
                                                         size_t variable) const {
  const MutexLock lock(opening_);
  std::weak_ptr<const ValuesFile>& known = open_[{step, variable}];
  if (auto open = known.lock()) return open;
  const std::string name = stepValuesName(series, step, manifest_.variables[variable].number);
  InputFile file(cacheFile(path_, name));
  FileInfo info{name, series.steps[step].values[variable].size, series.steps[step].values[variable].checksum};
  if (!manifest_.hasFeature(kSteps) && series.isFirstOfGeometry(step)) info = checkFile(file, manifest_);
  std::vector<BrickVariable> table = readVariableTable(file, info, bricks_);
  if (manifest_.hasEarlierSlopes())
    for (BrickVariable& record : table) record.largest_slope *= static_cast<float>(kEarlierSlopes);
  auto opened = std::make_shared<const ValuesFile>(ValuesFile{std::move(file), std::move(table)});
  known = opened;
  return opened;
}

}  // namespace curvisplat
