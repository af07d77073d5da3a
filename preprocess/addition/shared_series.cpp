#include "preprocess/addition/shared_series.h"

#include <sys/stat.h>
#include <chrono>
#include <exception>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <regex>
#include <span>
#include <system_error>
#include <utility>

#include "preprocess/addition/series_steps.h"
#include "preprocess/convert/preflight.h"
#include "stream/base/checksum.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

uint64_t sizeOfFiles(const std::vector<FileReport>& files) {
  uint64_t bytes = 0;
  for (const FileReport& file : files) bytes += file.bytes;
  return bytes;
}

fs::path besideCache(const fs::path& cache, const char* suffix) {
  fs::path folder = fs::absolute(cache);
  folder += suffix;
  return folder;
}

/// Removes the ranks' folders for temporary files that killed conversions to `cache` have left in `folder`.
void removeAbandonedScratch(const fs::path& folder, const fs::path& cache) {
  const std::regex rest(R"(\d+\.\d+\.\d+)");  // rank, process, count (ScratchFolder::newPath)
  const std::string begin = scratchNameOfRanks(cache);
  std::vector<fs::path> abandoned;
  std::error_code error;  // ScratchFolder reports it
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(begin) && std::regex_match(name.substr(begin.size()), rest))
      abandoned.push_back(entry->path());
  }
  for (const fs::path& path : abandoned) removeAll(path);  // another rank may be doing the same
}

}  // namespace

std::string scratchNameOfRanks(const fs::path& cache) {
  const fs::path path = fs::absolute(cache).lexically_normal();
  // Folders of one path may be different ones on different machines.
  struct stat parent {};
  ::stat(path.parent_path().c_str(), &parent);
  const std::string key = fmt::format("{}\n{}", path.string(), parent.st_ino);
  return fmt::format("{}.{:016x}.rank", ScratchFolder::beginOfName(path),
                     checksumOf(std::as_bytes(std::span(key))));
}

void removeLeftOfRanks(const fs::path& cache, const fs::path& temporary_folder) {
  const fs::path folder = besideCache(cache, ".ranks");
  if (!hasUnfinished(folder)) return;
  const PartialFolder left(folder, false);  // locked, and removed at the end
  if (!temporary_folder.empty()) removeAbandonedScratch(temporary_folder, cache);
}

std::vector<StepSpan> dealSteps(uint64_t next, uint64_t count, uint64_t in_group, unsigned ranks) {
  std::vector<StepSpan> ranges;
  for (unsigned rank = 0; rank < ranks; ++rank) {
    const uint64_t end = std::min(next + kStepGroup - (rank == 0 ? in_group : 0), count);
    ranges.push_back({next, end});
    next = end;
  }
  return ranges;
}

SharedSteps::SharedSteps(const SeriesInput& input, AddStepOptions add, Ranks& ranks, Progress& progress)
    : input_(input),
      add_(std::move(add)),
      ranks_(ranks),
      progress_(progress),
      folder_(besideCache(add_.cache, kRanksSuffix)) {
  if (ranks_.isFirst()) locked_ = std::make_unique<PartialFolder>(besideCache(add_.cache, ".ranks"), false);
  if (ranks_.isFirst()) prepareSets(add_.cache);
  ranks_.barrier();
  if (!fs::is_directory(folder_))
    throw Error("{}: does not exist here; several ranks need a file system that they share",
                folder_.string());
  // As long as that folder is locked, no other program converts this series. At each rank: --tmp may be of its machine.
  if (!add_.temporary_folder.empty()) removeAbandonedScratch(add_.temporary_folder, add_.cache);
  ranks_.barrier();
  if (ranks_.isFirst()) return;
  add_.given_folders = {folderOf(fs::absolute(add_.cache))};
  if (!add_.temporary_folder.empty()) add_.given_folders.push_back(add_.temporary_folder);
  const fs::path parent = add_.temporary_folder.empty() ? folder_ : add_.temporary_folder;
  scratch_ = std::make_unique<ScratchFolder>(
      ScratchFolder::newPath(parent, scratchNameOfRanks(add_.cache) + std::to_string(ranks_.rank())),
      ScratchFolder::Folder::kMake);
  add_.temporary_folder = scratch_->path();
}

SharedSteps::~SharedSteps() {
  // After a failure the others still write into the folder, until they hear of it.
  if (std::uncaught_exceptions() > 0 && ranks_.isFirst() && !ranks_.alone()) {
    ranks_.announceFailure();
    ranks_.waitForFailures(std::chrono::seconds(3));
  }
  if (ranks_.isFirst()) return;
  scratch_.reset();  // it may lie in the shared folder
  removeFolderOfRank(partOf(ranks_.rank()), folder_);
}

fs::path SharedSteps::partOf(unsigned rank) const {
  return folder_ / fmt::format("rank{}.splats", rank);
}

ConvertedSteps SharedSteps::convertPart(const Start& start) const {
  const std::vector<StepSpan> ranges = dealSteps(start.next, input_.count, start.in_group, ranks_.count());
  const StepSpan& own = ranges[ranks_.rank()];
  ConvertedSteps converted;
  if (own.begin == own.end) return converted;
  AddStepOptions options = add_;
  options.cache = partOf(ranks_.rank());
  options.to_part = true;
  options.resume = false;
  options.expect_new_geometry = start.expects_geometry != 0;
  try {
    removeAll(options.cache);
    const CacheReader series(add_.cache, start.step);
    double last = series.series().steps[start.step].time + static_cast<double>(own.begin - start.next);
    const TimeUnit unit{series.seriesManifest().time_unit, series.seriesManifest().calendar};
    makePart(series, options.cache, progress_);
    for (uint64_t number = own.begin; number < own.end; ++number) {
      progress_.throwIfStopped();
      const std::unique_ptr<DataSource> source = input_.open(number);
      const std::optional<double> stated = timeOf(source->description(), unit);
      options.time = stated.value_or(last + 1);
      const AddStepReport added = addStep(*source, options, progress_);
      last = added.time;
      options.expect_new_geometry = added.new_geometry;
      converted.steps.push_back({stated.has_value(), added.new_geometry, sizeOfFiles(added.files),
                                 source->description().files, added.warnings});
    }
  } catch (const Interrupted&) {
    throw;
  } catch (const DiskFull& full) {
    const RoomNeeded room{add_.given_folders, "steps and their temporary files", kFullDiskHint};
    converted.error = room.error(full).what();
  } catch (const Error& error) {
    converted.error = error.what();
  }
  return converted;
}

bool SharedSteps::join(unsigned of, const StepSpan& range, const ConvertedSteps& converted,
                       const std::function<void(uint64_t number, const AddStepReport&)>& took) const {
  if (range.begin == range.end || converted.steps.empty()) return converted.error.empty();
  const CacheReader part(partOf(of));
  for (uint64_t n = 0; n < converted.steps.size(); ++n) {
    progress_.throwIfStopped();
    const ConvertedSteps::Step& step = converted.steps[n];
    const CacheLock lock(add_.cache);
    if (!takeStep(lock, {part, n + 1, step.sources, step.states_time}, progress_)) return false;
    AddStepReport report;
    report.time = part.series().steps[n + 1].time;
    report.new_geometry = step.new_geometry;
    report.nodes = part.manifest().nodes;
    report.files = {{"", step.bytes}};
    report.warnings = step.warnings;
    took(range.begin + n, report);
  }
  return converted.error.empty();
}

Ranks::Bytes toBytes(const ConvertedSteps& converted) {
  nlohmann::json json{{"error", converted.error}, {"steps", nlohmann::json::array()}};
  for (const ConvertedSteps::Step& step : converted.steps)
    json["steps"].push_back({step.states_time, step.new_geometry, step.bytes, step.sources, step.warnings});
  // Names of files may be of any bytes, which no JSON text has.
  const std::vector<std::uint8_t> packed = nlohmann::json::to_cbor(json);
  return toBytes(packed);
}

ConvertedSteps convertedFrom(const Ranks::Bytes& bytes) {
  const auto json = nlohmann::json::from_cbor(fromBytes<std::uint8_t>(bytes));
  ConvertedSteps converted;
  converted.error = json["error"];
  for (const auto& step : json["steps"])
    converted.steps.push_back({step[0], step[1], step[2], step[3].get<std::vector<std::string>>(),
                               step[4].get<std::vector<std::string>>()});
  return converted;
}

}  // namespace curvisplat
