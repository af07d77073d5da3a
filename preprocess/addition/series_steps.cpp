#include "preprocess/addition/series_steps.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <span>
#include <system_error>
#include <utility>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/series.h"
#include "stream/cache/values_writer.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kManifest = "manifest.json";

bool sameFile(const Manifest& a, const Manifest& b, const std::string& name) {
  const FileInfo *const of_a = a.file(name), *const of_b = b.file(name);
  return of_a && of_b && of_a->size == of_b->size && of_a->checksum == of_b->checksum;
}

bool sameValues(const SeriesStep& a, const SeriesStep& b) {
  return a.time == b.time && std::equal(a.values.begin(), a.values.end(), b.values.begin(), b.values.end(),
                                        [](const StepValues& x, const StepValues& y) {
                                          return x.size == y.size && x.checksum == y.checksum;
                                        });
}

void copyDurably(const fs::path& from, const fs::path& to, const Progress& progress) {
  constexpr uint64_t kAtOnce = uint64_t{4} << 20;
  const InputFile in(from);
  OutputFile out(to);
  std::vector<std::byte> bytes(std::min(in.size(), kAtOnce));
  for (uint64_t at = 0; at < in.size(); at += kAtOnce) {
    progress.throwIfStopped();
    const std::span part = std::span(bytes).first(std::min(kAtOnce, in.size() - at));
    in.readAt(at, part);
    out.append(part);
  }
  out.close();
}

/// Names in a locked cache that are taken back unless the step comes into the series. If another cache has
/// replaced that one, files of these names are that cache's.
class NewNames {
 public:
  NewNames(const CacheLock& lock, const Progress& progress) : lock_(lock), progress_(progress) {}
  ~NewNames() {
    if (!lock_.isStillThere()) return;
    for (const fs::path& path : paths_) removeFileIfThere(path);
    if (!folder_.empty()) removeCacheFolder(folder_);
  }
  void add(const fs::path& from, const fs::path& to) {
    progress_.throwIfStopped();
    lock_.requireStillThere();
    paths_.push_back(to);
    linkOrCopy(from, to, progress_);
  }
  void addFolder(const fs::path& path) {
    lock_.requireStillThere();
    requireCacheFolderRemoved(path);  // a killed program's
    makeFolder(path);
    folder_ = path;
  }
  /// Keeps the names if `put` puts them into the series' manifest, or says that a power loss may undo that.
  void keepIf(const std::function<void()>& put) {
    try {
      put();
    } catch (const NameNotSynced&) {
      keep();
      throw;
    }
    keep();
  }

 private:
  const CacheLock& lock_;
  const Progress& progress_;
  void keep() {
    paths_.clear();
    folder_.clear();
  }

  std::vector<fs::path> paths_;  // of files
  fs::path folder_;
};

/// See takeStep().
class StepMove {
 public:
  StepMove(const CacheLock& lock, const PartStep& step, const Progress& progress)
      : lock_(lock),
        progress_(progress),
        to_(openAtLast(lock.cache())),
        from_(step.part),
        number_(step.number),
        taken_(theirs().steps[step.number]),
        new_step_{taken_.time, {}, step.sources} {
    for (const StepValues& values : taken_.values) new_step_.ranges.push_back({values.min, values.max});
    const double last = ours().steps.back().time;
    fits_ = step.states_time ? taken_.time > last : taken_.time == last + 1;
  }

  bool run() {
    if (!fits_) return false;
    const auto geometry = ours().geometryOf(taken_.grid_checksum);
    const bool is_first = theirs().isFirstOfGeometry(number_);
    if (is_first && !geometry) return takeGeometry();
    if (is_first || !geometry) return false;
    return takeValues(*geometry);
  }

 private:
  static CacheReader openAtLast(const fs::path& path) {
    CacheReader first(path);
    const uint64_t last = first.series().steps.size() - 1;
    return last == 0 ? std::move(first) : first.atStep(last);
  }

  const Series& ours() const { return to_.series(); }
  const Series& theirs() const { return from_.series(); }

  bool takeGeometry() {
    const fs::path from = cacheFolder(from_.cachePath(), geometryFolderName(taken_.geometry));
    const fs::path to = lock_.cache() / geometryFolderName(ours().geometries());
    const Manifest manifest = readManifest(from);
    NewNames names(lock_, progress_);
    names.addFolder(to);
    for (const FileInfo& file : manifest.files) names.add(cacheFile(from, file.name), to / file.name);
    names.add(cacheFile(from, kManifest), to / kManifest);
    syncDirectory(to);
    names.keepIf([&] { addGeometryStep(lock_, to_, new_step_); });
    return true;
  }

  bool takeValues(uint32_t geometry) {
    const CacheReader base = to_.atStep(ours().first_steps[geometry]);
    const CacheReader source = from_.atStep(number_);
    if (!sameFile(base.manifest(), source.manifest(), "geometry.bin") || !samePrediction(geometry))
      return false;
    const uint64_t number = ours().steps.size();
    SeriesStep step = taken_;
    step.geometry = geometry;
    step.geometry_checksum = ours().steps[ours().first_steps[geometry]].geometry_checksum;
    NewNames names(lock_, progress_);
    for (const VariableInfo& variable : to_.seriesManifest().variables) {
      const std::string name = stepValuesName(theirs(), number_, variable.number);
      names.add(cacheFile(source.path(), name),
                base.path() / fmt::format("var.{}.{}.bin", variable.number, number));
    }
    std::vector<FileInfo> others;
    if (const FileInfo* const faces = from_.seriesManifest().file(facesFileOfStep(number_))) {
      others.push_back({facesFileOfStep(number), faces->size, faces->checksum});
      names.add(cacheFile(from_.cachePath(), faces->name), lock_.cache() / others[0].name);
    }
    syncDirectory(base.path());
    names.keepIf([&] { addWrittenStep(lock_, to_, std::move(step), new_step_, others); });
    return true;
  }

  bool samePrediction(uint32_t geometry) const {
    const uint64_t next = ours().steps.size();
    const auto wanted = referenceSteps(ours(), geometry, next);
    const auto found = referenceSteps(theirs(), taken_.geometry, number_, taken_.geometry == 0);
    if (wanted.size() != found.size()) return false;
    for (size_t n = 0; n < wanted.size(); ++n)
      if (next - wanted[n] != number_ - found[n] ||
          !sameValues(ours().steps[wanted[n]], theirs().steps[found[n]]))
        return false;
    return true;
  }

  const CacheLock& lock_;
  const Progress& progress_;
  const CacheReader to_;
  const CacheReader& from_;
  const uint64_t number_;
  const SeriesStep& taken_;
  NewStep new_step_;
  bool fits_ = false;
};

}  // namespace

namespace {

/// Removes the steps of sets that the cache does not have.
void cutSets(const CacheLock& lock, const CacheReader& whole) {
  const uint64_t steps = whole.series().steps.size();
  for (size_t n = 0; n < whole.seriesManifest().own_blanks.size(); ++n) {
    const CacheLock of_set(lock, n);
    const CacheReader set(of_set.cache());
    if (set.series().steps.size() > steps) removeStepsFrom(steps, of_set, set);
  }
}

void require(const char* feature, Manifest& manifest) {
  if (!manifest.hasFeature(feature)) manifest.requirements.emplace_back(feature);
}

/// makePart() with the time of its step 0.
void makePartAt(double time, const CacheReader& series, const fs::path& path, const Progress& progress) {
  const uint32_t geometry = series.series().steps[series.step()].geometry;
  const CacheReader first = series.atStep(series.series().first_steps[geometry]);
  makeFolder(path);
  Manifest manifest = first.manifest();
  std::erase_if(manifest.files, [](const FileInfo& file) { return file.name.starts_with("faces.step"); });
  for (const FileInfo& file : manifest.files)
    linkOrCopy(cacheFile(first.path(), file.name), path / file.name, progress);
  manifest.steps.front().time = time;
  manifest.own_blanks = series.seriesManifest().own_blanks;
  for (size_t n = 0; n < manifest.own_blanks.size(); ++n) {
    const fs::path folder = path / ownBlanksFolderName(n);
    makePartAt(time, series.ownBlanks(n), folder, progress);
    manifest.own_blanks[n].checksum = firstStepChecksum(CacheReader(folder).series());
    require(kOwnBlanks, manifest);
    require(kOwnBlanksOfSteps, manifest);
  }
  replaceManifest(path, manifest);  // a file of its own: it is what locks a cache
}

}  // namespace

void prepareSets(const fs::path& cache) {
  if (readManifest(cache).own_blanks.empty()) return;
  const CacheLock lock(cache);
  const CacheReader whole(cache);
  cutSets(lock, whole);
  Manifest manifest = whole.seriesManifest();
  if (manifest.hasFeature(kOwnBlanksOfSteps)) return;
  for (size_t n = 0; n < manifest.own_blanks.size(); ++n)
    manifest.own_blanks[n].checksum = firstStepChecksum(whole.ownBlanks(n).series());
  require(kOwnBlanksOfSteps, manifest);
  replaceManifest(cache, manifest);
}

void makePart(const CacheReader& series, const fs::path& path, const Progress& progress) {
  makePartAt(series.time(), series, path, progress);
}

bool takeStep(const CacheLock& lock, const PartStep& step, const Progress& progress) {
  const CacheReader whole(lock.cache());
  bool fits = true;
  for (size_t n = 0; n < whole.seriesManifest().own_blanks.size() && fits; ++n) {
    const CacheReader set = whole.ownBlanks(n), of_part = step.part.ownBlanks(n);
    const bool has_ended = set.series().steps.size() < whole.series().steps.size() ||
                           of_part.series().steps.size() <= step.number;
    if (has_ended) continue;
    const CacheLock of_set(lock, n);
    fits = StepMove(of_set, {of_part, step.number, step.sources, step.states_time}, progress).run();
  }
  if (fits && StepMove(lock, step, progress).run()) return true;
  cutSets(lock, whole);
  return false;
}

void linkOrCopy(const fs::path& from, const fs::path& to, const Progress& progress) {
  removeFileIfThere(to);
  std::error_code no_links;
  fs::create_hard_link(from, to, no_links);
  if (!no_links) return;
  try {
    copyDurably(from, to, progress);
  } catch (...) {
    removeFileIfThere(to);
    throw;
  }
}

namespace {

constexpr uint64_t kMaxStepsBack = 255;

}  // namespace

std::vector<uint64_t> referenceSteps(const Series& series, uint32_t geometry, uint64_t next,
                                     bool leaves_out_first) {
  std::vector<uint64_t> of_geometry;
  for (uint64_t step = leaves_out_first ? 1 : 0; step < next; ++step)
    if (series.steps[step].geometry == geometry) of_geometry.push_back(step);
  const uint64_t in_group = of_geometry.size() % kStepGroup;
  std::vector<uint64_t> references;
  for (uint64_t n = 0; n < in_group; ++n) {
    const uint64_t step = of_geometry[of_geometry.size() - 1 - n];
    if (next - step > kMaxStepsBack) break;
    references.push_back(step);
  }
  return references;
}

StepReferences::StepReferences(const CacheReader& cache, bool leaves_out_first) {
  const Series& series = cache.series();
  const uint64_t next = series.steps.size();
  const std::vector<uint64_t> steps =
      referenceSteps(series, series.steps[cache.step()].geometry, next, leaves_out_first);
  for (size_t n = 0; n < steps.size(); ++n) {
    steps_back_[n] = static_cast<uint8_t>(next - steps[n]);
    readers_.push_back(cache.atStep(steps[n]));
  }
}

TimeReferences StepReferences::of(uint32_t brick, size_t variable, Scratch& scratch) const {
  TimeReferences references;
  references.steps_back = steps_back_;
  // The nearer one may be predicted from the one further back, which comes first.
  KeptValues kept(readers_.size() > 1 ? KeptValues::charge(kMaxBrickSplats) : 0);
  for (size_t n = readers_.size(); n-- > 0;) {
    readers_[n].readVariable(brick, variable, scratch.values[n], nullptr, &kept);
    references.values[n] = arraysOf(std::as_const(scratch.values[n]));
  }
  return references;
}

}  // namespace curvisplat
