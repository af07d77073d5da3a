#include "preprocess/addition/join_series.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <system_error>

#include "preprocess/addition/series_steps.h"
#include "stream/base/disk_space.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/cache_update.h"
#include "stream/cache/partial_folder.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxParts = 1'000'000, kMaxSteps = 10'000'000, kLargestRecord = uint64_t{1} << 30;

std::string nameOf(const SeriesPart& part) {
  return fmt::format("{}of{}", part.index + 1, part.count);
}

fs::path recordPath(const fs::path& folder, const SeriesPart& part) {
  return folder / (nameOf(part) + ".json");
}

/// The facts that writePartRecord() has noted.
struct PartRecord {
  uint64_t steps = 0;  // of the whole series
  std::vector<StepOrigin> origins;
};

PartRecord readRecord(const fs::path& folder, const SeriesPart& part) {
  const fs::path path = recordPath(folder, part);
  if (!fs::exists(path))
    throw Error("{}: part {} of {} is missing or unfinished; run its command again, with --resume",
                folder.string(), part.index + 1, part.count);
  const JsonDocument document(readTextFile(path, kLargestRecord), path.string(), "the record of a part",
                              "convert the part again");
  PartRecord record;
  record.steps = document.root().at("steps_of_series").count(0, kMaxSteps);
  for (const JsonField& step : document.root().at("steps").elements())
    record.origins.push_back({step.at("states_time").flag(), step.at("sources").texts()});
  return record;
}

/// How many parts there are: any record's name tells.
uint64_t countParts(const fs::path& folder) {
  std::error_code error;
  std::optional<uint64_t> count;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    unsigned long long index = 0, of = 0;
    char rest = 0;
    const std::string name = entry.path().filename().string();
    if (std::sscanf(name.c_str(), "%lluof%llu.jso%c", &index, &of, &rest) != 3 || rest != 'n') continue;
    if (of < 1 || of > kMaxParts || index > of) continue;
    if (count && *count != of)
      throw Error(
          "{0}: has parts of {1} and parts of {2}, which are of two conversions; remove the files *of{1}.* "
          "or *of{2}.*",
          folder.string(), std::min<uint64_t>(*count, of), std::max<uint64_t>(*count, of));
    count = of;
  }
  if (!count)
    throw Error("{}: has no finished parts; expected the folder that convert --part i/n writes",
                folder.string());
  return *count;
}

/// Files of the first step that the manifest lists, in the order of their names.
std::vector<FileInfo> firstStepFiles(const CacheReader& cache) {
  std::vector<FileInfo> files = cache.manifest().files;
  std::erase_if(files, [](const FileInfo& file) {
    return file.name == kStepsFileName || file.name.starts_with("faces.step");
  });
  std::sort(files.begin(), files.end(), [](const FileInfo& a, const FileInfo& b) { return a.name < b.name; });
  return files;
}

/// Describes in what two parts, open at step 0, were not converted alike; empty if they were. The first step,
/// which all parts have, shows it.
std::string differenceOf(const CacheReader& a, const CacheReader& b) {
  const Manifest &of_a = a.seriesManifest(), &of_b = b.seriesManifest();
  const auto sameVariable = [](const VariableInfo& x, const VariableInfo& y) {
    return x.number == y.number && x.name == y.name && x.unit == y.unit;
  };
  const auto sameSet = [](const OwnBlanks& x, const OwnBlanks& y) { return x.variables == y.variables; };
  if (!std::equal(of_a.variables.begin(), of_a.variables.end(), of_b.variables.begin(), of_b.variables.end(),
                  sameVariable) ||
      !std::equal(of_a.own_blanks.begin(), of_a.own_blanks.end(), of_b.own_blanks.begin(),
                  of_b.own_blanks.end(), sameSet) ||
      of_a.cells != of_b.cells)
    return "set of scalars";
  const auto features = [](const Manifest& manifest) {
    std::set<std::string> all(manifest.requirements.begin(), manifest.requirements.end());
    all.erase(kSteps);
    all.erase(kOwnBlanksOfSteps);
    return all;
  };
  if (features(of_a) != features(of_b) || of_a.overlap != of_b.overlap)
    return "form (--value-precision, --overlap)";
  const auto sameFile = [](const FileInfo& x, const FileInfo& y) {
    return x.name == y.name && x.size == y.size && x.checksum == y.checksum;
  };
  const auto files_a = firstStepFiles(a), files_b = firstStepFiles(b);
  if (a.series().steps[0].time != b.series().steps[0].time ||
      !std::equal(files_a.begin(), files_a.end(), files_b.begin(), files_b.end(), sameFile))
    return "first step";
  for (size_t n = 0; n < of_a.own_blanks.size(); ++n)
    if (std::string what = differenceOf(a.ownBlanks(n), b.ownBlanks(n)); !what.empty()) return what;
  return "";
}

/// See joinParts().
class Joining {
 public:
  Joining(const JoinOptions& options, Progress& progress)
      : options_(options), progress_(progress), count_(countParts(options.folder)) {
    for (uint64_t index = 0; index < count_; ++index) {
      const SeriesPart part{index, count_};
      // A part without steps need not have been converted.
      if (index > 0 && !fs::exists(recordPath(options.folder, part)) &&
          placesOfPart(part, records_[0].steps).empty()) {
        records_.push_back({records_[0].steps, {}});
        continue;
      }
      records_.push_back(readRecord(options.folder, part));
      if (records_[index].steps != records_[0].steps)
        throw Error("{}: part {} is of a series of {} steps, part 1 of one of {}; convert both again",
                    options.folder.string(), index + 1, records_[index].steps, records_[0].steps);
    }
  }

  JoinReport run() {
    PartialFolder partial(options_.output, options_.overwrite);
    JoinReport report{count_, 0, 0};
    progress_.begin("join", records_[0].steps, "steps");
    copyFirst(partial.path());
    prepareSets(partial.path());
    for (uint64_t index = 1; index < count_; ++index) add(partial.path(), index);
    const CacheReader joined(partial.path());
    report.steps = joined.series().steps.size();
    report.geometries = joined.series().geometries();
    if (report.steps != records_[0].steps)
      throw Error("{}: the parts have {} steps together; expected {}", options_.folder.string(), report.steps,
                  records_[0].steps);
    partial.putIntoPlace();
    partial.removeReplaced();
    progress_.end();
    return report;
  }

 private:
  /// The first part is the beginning of the series.
  void copyFirst(const fs::path& to) {
    const fs::path from = partCache(options_.folder, {0, count_});
    const CacheReader checked(from);
    for (const auto& entry : fs::recursive_directory_iterator(from)) {
      progress_.throwIfStopped();
      const fs::path target = to / fs::relative(entry.path(), from);
      if (entry.is_symlink()) throw Error("{}: is a link, which no cache has", entry.path().string());
      if (entry.is_directory())
        makeFolder(target);
      else if (isChangedInPlace(target.filename().string()))
        writeFileDurably(target, bytesOf(entry.path()));
      else
        linkOrCopy(entry.path(), target, progress_);
    }
    for (const auto& entry : fs::recursive_directory_iterator(to))
      if (entry.is_directory()) syncDirectory(entry.path());
    syncDirectory(to);
    progress_.advance(checked.series().steps.size());
  }

  /// A second name would change the part with the series.
  static bool isChangedInPlace(const std::string& name) {
    return name == "manifest.json" || name == kStepsFileName;
  }
  static std::vector<std::byte> bytesOf(const fs::path& path) {
    const InputFile file(path);
    std::vector<std::byte> bytes(file.size());
    file.readAt(0, std::span(bytes));
    return bytes;
  }

  void add(const fs::path& series, uint64_t index) {
    const SeriesPart part{index, count_};
    if (records_[index].origins.empty()) return;
    const CacheReader cache(partCache(options_.folder, part));
    const std::vector<uint64_t> places = placesOfPart(part, records_[0].steps);
    if (cache.series().steps.size() != places.size() || records_[index].origins.size() != places.size())
      throw Error("{}: has {} steps, expected {}; convert the part again", cache.cachePath().string(),
                  cache.series().steps.size(), places.size());
    if (const std::string what = differenceOf(CacheReader(partCache(options_.folder, {0, count_})), cache);
        !what.empty())
      throw Error(
          "{}: part {} was not converted as part 1 was: it has another {}; convert it again with the same "
          "files and options",
          options_.folder.string(), index + 1, what);
    for (uint64_t step = 1; step < places.size(); ++step) {
      progress_.throwIfStopped();
      const StepOrigin& origin = records_[index].origins[step];
      const CacheLock lock(series);  // of a manifest that each step replaces
      if (!takeStep(lock, {cache, step, origin.sources, origin.states_time}, progress_))
        throw Error(
            "{}: step {} cannot be joined: its grid is that of some steps before it, or its time does not "
            "follow theirs; convert the series in one process, or by ranks",
            options_.folder.string(), places[step]);
      progress_.advance(1);
    }
  }

  const JoinOptions& options_;
  Progress& progress_;
  const uint64_t count_;
  std::vector<PartRecord> records_;
};

}  // namespace

std::vector<uint64_t> placesOfPart(const SeriesPart& part, uint64_t steps) {
  const uint64_t groups = (steps + kStepGroup - 1) / kStepGroup;
  const auto begin = [&](uint64_t index) {
    // Rounded up, so that the first part has the first step.
    return std::min((groups * index + part.count - 1) / part.count * kStepGroup, steps);
  };
  std::vector<uint64_t> places;
  for (uint64_t step = begin(part.index); step < begin(part.index + 1); ++step) places.push_back(step);
  if (!places.empty() && places.front() > 0) places.insert(places.begin(), 0);
  return places;
}

fs::path partsFolder(const fs::path& cache) {
  fs::path folder = cache;
  folder += ".parts";
  return folder;
}

fs::path partCache(const fs::path& folder, const SeriesPart& part) {
  return folder / (nameOf(part) + ".splats");
}

void makePartsFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directory(folder, error);  // another part may do so at the same time
  if (error || !fs::is_directory(folder))
    throw Error("{}: cannot be made: {}", folder.string(), error ? error.message() : "is not a directory");
}

void removePartRecord(const fs::path& folder, const SeriesPart& part) {
  if (const auto failure = removeFileIfThere(recordPath(folder, part)))
    throw Error("{}: cannot be removed: {}", recordPath(folder, part).string(), failure.message());
}

void writePartRecord(const fs::path& folder, const SeriesPart& part, uint64_t steps,
                     const std::vector<StepOrigin>& origins) {
  nlohmann::ordered_json json{{"steps_of_series", steps}, {"steps", nlohmann::json::array()}};
  for (const StepOrigin& origin : origins)
    json["steps"].push_back({{"states_time", origin.states_time}, {"sources", origin.sources}});
  // A name that is not in UTF-8 is no JSON: let it be an error of one line.
  try {
    writeFileDurably(recordPath(folder, part), json.dump(1) + "\n");
  } catch (const nlohmann::json::exception&) {
    throw Error("{}: a file's name is not valid UTF-8; rename it", folder.string());
  }
}

JoinReport joinParts(const JoinOptions& options, Progress& progress) {
  checkReplaceable(options.output, options.overwrite);
  const RoomNeeded room{{folderOf(options.output)}, "the joined cache", "make room there"};
  return room.during([&] { return Joining(options, progress).run(); });
}

}  // namespace curvisplat
