#include "stream/cache/values_writer.h"

#include <algorithm>
#include <cerrno>
#include <set>
#include <span>
#include <string>
#include <system_error>
#include <utility>

#include "stream/base/checksum.h"
#include "stream/base/disk_space.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/stream_file.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPartSuffix = ".part";

}  // namespace

VariableWriter::VariableWriter(const CacheLock& lock, Manifest manifest, std::vector<VariableInfo> variables)
    : ValuesWriter(manifest.root, variables), lock_(&lock), manifest_(std::move(manifest)) {
  removeLeftovers();
  uint32_t number = 0;
  for (const VariableInfo& variable : manifest_.variables) number = std::max(number, variable.number + 1);
  try {
    for (VariableInfo& variable : variables) {
      variable.number = number++;
      const fs::path path = lock.cache() / variableFileName(variable);
      fs::path part = path;
      part += kPartSuffix;
      OutputFile file(part, Caching::kPages, OutputFile::Existing::kEmpty, path);
      files_.push_back({std::move(variable), path, part, std::move(file), {}, false});
      beginVariableFile(files_.back().file);
      files_.back().table.resize(manifest_.bricks);
    }
  } catch (...) {
    removeLeftovers();
    throw;
  }
}

VariableWriter::~VariableWriter() {
  // If another cache has replaced this one, files of these names are that cache's.
  if (in_place_ || !lock_->isStillThere()) return;
  for (const NewFile& file : files_) removeFileIfThere(file.is_renamed ? file.path : file.part);
  for (const FileInfo& other : others_) removeFileIfThere(lock_->cache() / other.name);
}

/// Removes the files that a killed program left behind: those that the manifest does not list.
void VariableWriter::removeLeftovers() const {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(lock_->cache(), ignored)) {
    const std::string name = entry.path().filename().string();
    const bool was_new = name.starts_with("var.") || isFacesFile(name) || name.ends_with(kPartSuffix);
    if (!manifest_.file(name) && was_new && isCacheFile(entry)) removeFileIfThere(entry.path());
  }
}

std::vector<uint32_t> VariableWriter::numbers() const {
  std::vector<uint32_t> numbers;
  for (const NewFile& file : files_) numbers.push_back(file.variable.number);
  return numbers;
}

void VariableWriter::append(uint32_t brick, std::span<const EncodedValues> values) {
  CURVISPLAT_CHECK_OP(values.size(), ==, files_.size());
  for (size_t n = 0; n < values.size(); ++n) appendValues(files_[n].file, values[n], files_[n].table[brick]);
}

std::vector<FileInfo> VariableWriter::finish(const std::vector<std::string>& sources) {
  std::vector<FileInfo> infos;
  for (size_t v = 0; v < files_.size(); ++v)
    infos.push_back(finishVariableFile(files_[v].file, variableFileName(files_[v].variable), files_[v].table,
                                       histograms().of(v)));
  infos.insert(infos.end(), others_.begin(), others_.end());
  if (!lock_->isStillThere())
    throw Error(
        "{}: another program has replaced the cache; the new cache was not changed: add the scalar to it "
        "again",
        lock_->cache().string());
  for (NewFile& file : files_) {
    if (SystemCalls::current().rename(file.part.c_str(), file.path.c_str()) < 0)
      failToRename(errno, file.part, file.path);
    file.is_renamed = true;
  }
  // The names of the payload files must be on the disk before a manifest that lists them.
  syncDirectory(lock_->cache());

  for (const NewFile& file : files_) {
    manifest_.variables.push_back(file.variable);
    manifest_.steps.front().variables.push_back(file.variable.number);
  }
  manifest_.files.insert(manifest_.files.end(), infos.begin(), infos.end());
  addSources(sources, manifest_);
  try {
    replaceManifest(lock_->cache(), manifest_);
  } catch (const NameNotSynced&) {
    in_place_ = true;
    throw;
  }
  in_place_ = true;
  return infos;
}

namespace {

/// Appends the step to the series and replaces the manifest. `files`: further files of the step.
void commitStep(const CacheLock& lock, const Manifest& old, Series series, SeriesStep step,
                const NewStep& added, std::span<const FileInfo> files) {
  Manifest manifest = old;
  for (size_t v = 0; v < manifest.variables.size(); ++v) {
    step.values[v].min = added.ranges[v].min;
    step.values[v].max = added.ranges[v].max;
    VariableInfo& variable = manifest.variables[v];
    variable.min = std::min(variable.min, added.ranges[v].min);
    variable.max = std::max(variable.max, added.ranges[v].max);
  }
  series.add(std::move(step));
  manifest.files.insert(manifest.files.end(), files.begin(), files.end());
  try {
    const FileInfo info = appendStep(lock.cache(), manifest, series);
    std::erase_if(manifest.files, [](const FileInfo& file) { return file.name == kStepsFileName; });
    manifest.files.push_back(info);
    if (!manifest.hasFeature(kSteps) || !files.empty())
      syncDirectory(lock.cache());  // names must be on the disk before a manifest that lists them
    if (!manifest.hasFeature(kSteps)) manifest.requirements.push_back(kSteps);
    addSources(added.sources, manifest);
    replaceManifest(lock.cache(), manifest);
  } catch (const NameNotSynced&) {
    throw;
  } catch (...) {
    if (lock.isStillThere()) cutAppended(lock.cache(), old);
    throw;
  }
}

/// The variables with their ranges at the new step.
std::vector<VariableInfo> variablesOf(const CacheReader& cache, const NewStep& step) {
  std::vector<VariableInfo> variables = cache.seriesManifest().variables;
  CURVISPLAT_CHECK_OP(step.ranges.size(), ==, variables.size());
  for (size_t v = 0; v < variables.size(); ++v) {
    variables[v].min = step.ranges[v].min;
    variables[v].max = step.ranges[v].max;
  }
  return variables;
}

}  // namespace

StepWriter::StepWriter(const CacheLock& lock, const CacheReader& cache, NewStep step)
    : ValuesWriter(cache.manifest().root, variablesOf(cache, step)),
      lock_(&lock),
      folder_(cache.path()),
      manifest_(cache.seriesManifest()),
      series_(cache.series()),
      geometry_(cache.series().steps[cache.step()].geometry),
      added_(std::move(step)) {
  try {
    for (const VariableInfo& variable : manifest_.variables) {
      const fs::path path = folder_ / fmt::format("var.{}.{}.bin", variable.number, series_.steps.size());
      fs::path part = path;
      part += kPartSuffix;
      SystemCalls::current().remove(part.c_str());  // a killed program's; which may be a link
      files_.push_back(
          {path, part, OutputFile(part, Caching::kPages, OutputFile::Existing::kEmpty, path), {}, false});
      beginVariableFile(files_.back().file);
      files_.back().table.resize(cache.bricks().size());
    }
  } catch (...) {
    removeFiles();
    throw;
  }
}

StepWriter::~StepWriter() {
  // If another cache has replaced this one, files of these names are that cache's.
  if (in_place_ || !lock_->isStillThere()) return;
  removeFiles();
  for (const FileInfo& other : others_) removeFileIfThere(lock_->cache() / other.name);
}

void StepWriter::removeFiles() const {
  for (const NewFile& file : files_) removeFileIfThere(file.is_renamed ? file.path : file.part);
}

void StepWriter::append(uint32_t brick, std::span<const EncodedValues> values) {
  CURVISPLAT_CHECK_OP(values.size(), ==, files_.size());
  for (size_t n = 0; n < values.size(); ++n) appendValues(files_[n].file, values[n], files_[n].table[brick]);
}

std::vector<FileInfo> StepWriter::finish() {
  const SeriesStep& first = series_.steps[series_.first_steps[geometry_]];
  SeriesStep step{added_.time, geometry_, first.geometry_checksum, first.grid_checksum, {}};
  std::vector<FileInfo> infos;
  for (NewFile& file : files_) {
    infos.push_back(finishVariableFile(file.file, file.path.filename().string(), file.table,
                                       histograms().of(infos.size())));
    step.values.push_back({0, 0, infos.back().size, infos.back().checksum});
  }
  infos.insert(infos.end(), others_.begin(), others_.end());
  lock_->requireStillThere();
  for (NewFile& file : files_) {
    if (SystemCalls::current().rename(file.part.c_str(), file.path.c_str()) < 0)
      failToRename(errno, file.part, file.path);
    file.is_renamed = true;
  }
  syncDirectory(folder_);
  try {
    commitStep(*lock_, manifest_, series_, std::move(step), added_, others_);
  } catch (const NameNotSynced&) {
    in_place_ = true;
    throw;
  }
  in_place_ = true;
  return infos;
}

void addWrittenStep(const CacheLock& lock, const CacheReader& cache, SeriesStep step, const NewStep& added,
                    std::span<const FileInfo> others) {
  lock.requireStillThere();
  syncDirectory(lock.cache());
  commitStep(lock, cache.seriesManifest(), cache.series(), std::move(step), added, others);
}

void addGeometryStep(const CacheLock& lock, const CacheReader& cache, const NewStep& added) {
  const Series& series = cache.series();
  const fs::path folder = cacheFolder(lock.cache(), geometryFolderName(series.geometries()));
  const fs::path path = cacheFile(folder, "manifest.json");
  const std::string text = readTextFile(path);
  const Manifest manifest = Manifest::fromJson(text, path);
  SeriesStep step{added.time,
                  series.geometries(),
                  checksumOf(std::as_bytes(std::span(text))),
                  manifest.grid_checksum.value_or(0),
                  {}};
  for (const VariableInfo& variable : manifest.variables)
    if (const FileInfo* const file = manifest.file(fmt::format("var.{}.bin", variable.number)))
      step.values.push_back({0, 0, file->size, file->checksum});
  CURVISPLAT_CHECK_OP(step.values.size(), ==, cache.seriesManifest().variables.size());
  lock.requireStillThere();
  syncDirectory(lock.cache());
  commitStep(lock, cache.seriesManifest(), series, std::move(step), added, {});
}

void removeStepsFrom(uint64_t count, const CacheLock& lock, const CacheReader& cache) {
  const Series& series = cache.series();
  Series kept = series;
  kept.cutTo(count);
  Manifest manifest = cache.seriesManifest();
  for (size_t v = 0; v < manifest.variables.size(); ++v) {
    VariableInfo& variable = manifest.variables[v];
    variable.min = kept.steps.front().values[v].min;
    variable.max = kept.steps.front().values[v].max;
    for (const SeriesStep& step : kept.steps) {
      variable.min = std::min(variable.min, step.values[v].min);
      variable.max = std::max(variable.max, step.values[v].max);
    }
  }
  std::vector<fs::path> removed, folders;
  std::set<std::string> names{kStepsFileName};
  for (uint64_t step = kept.steps.size(); step < series.steps.size(); ++step) {
    const fs::path folder = lock.cache() / geometryFolderName(series.steps[step].geometry);
    if (series.isFirstOfGeometry(step)) folders.push_back(folder);
    for (const VariableInfo& variable : manifest.variables)
      removed.push_back(folder / stepValuesName(series, step, variable.number));
    names.insert(facesFileOfStep(step));
    removed.push_back(lock.cache() / facesFileOfStep(step));
  }
  std::erase_if(manifest.files, [&](const FileInfo& file) { return names.contains(file.name); });
  manifest.files.push_back(stepsFileOf(kept, manifest.variables.size()));
  lock.requireStillThere();
  replaceManifest(lock.cache(), manifest);
  for (const fs::path& path : removed) removeFileIfThere(path);
  for (const fs::path& folder : folders) removeCacheFolder(folder);
  cutAppended(lock.cache(), manifest);
}

}  // namespace curvisplat
