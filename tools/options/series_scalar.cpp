#include "tools/options/series_scalar.h"

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "preprocess/addition/convert_series.h"
#include "preprocess/addition/further_faces.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_lock.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/faces_file.h"
#include "tools/options/convert_arguments.h"
#include "tools/options/preview_folder.h"
#include "tools/options/series_input.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

SeriesOptions optionsLike(const CacheReader& cache, const fs::path& output) {
  SeriesOptions options;
  options.convert.output = output;
  options.convert.temporary_folder = output.parent_path();
  options.convert.title = cache.seriesManifest().title;
  options.convert.surfaces = FacesReader::open(cache.path(), cache.manifest()) != nullptr;
  options.convert.planes = planesOf(cache);
  if (cache.manifest().hasFeature(kFineValues)) options.convert.precision = ValuePrecision::kFine;
  if (cache.manifest().overlap == kOverlapAll) options.convert.overlap = Overlap::kAll;
  return options;
}

/// What other options would have changed.
bool isSameStep(const Manifest& a, const Manifest& b) {
  return a.nodes == b.nodes && a.blanked_nodes == b.blanked_nodes && a.splats == b.splats &&
         a.cells == b.cells && a.lower == b.lower && a.upper == b.upper;
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

}  // namespace

std::vector<StepFiles> stepsOfFiles(const std::vector<fs::path>& files) {
  OpenGridOptions options;
  options.grid = files.front();
  options.solutions.assign(files.begin() + 1, files.end());
  expandPatterns(options);
  return stepsOf(options);
}

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
  arguments.refine = before.seriesManifest().refined;

  const std::string folder_name = whole.filename().string() + ".adding";
  PreviewFolder::removeLeftOnes(whole.parent_path(), folder_name);
  const PreviewFolder folder(whole.parent_path(), folder_name);  // in the end, of the old one
  arguments.output = folder.path() / whole.filename();
  const SeriesOptions options = optionsLike(before, arguments.output);
  convertSeries(seriesInput(arguments, steps), options, progress, [&](const SeriesEvent& event) {
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

}  // namespace curvisplat
