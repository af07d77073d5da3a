#include "stream/cache/series.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <system_error>
#include <vector>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/mirror.h"
#include "stream/base/text.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/partial_folder.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr std::array<char, 8> kMagic{'C', 'V', 'S', 's', 't', 'e', 'p', 's'};
constexpr uint64_t kMaxSteps = 1'000'000;

struct StepsHeader {
  std::array<char, 8> magic = kMagic;  //  0
  uint32_t version = 1;                //  8
  uint32_t variables = 0;              // 12
};                                     // 16
static_assert(sizeof(StepsHeader) == 16);

struct StepRecord {
  double time;                 //  0
  uint32_t geometry;           //  8
  uint32_t reserved;           // 12: zero
  uint64_t geometry_checksum;  // 16
  uint64_t grid_checksum;      // 24
};                             // 32
static_assert(sizeof(StepRecord) == 32);

struct StepValuesRecord {
  double min, max;          //  0
  uint64_t size, checksum;  // 16
};                          // 32
static_assert(sizeof(StepValuesRecord) == 32 && sizeof(StepValues) == 32);

uint64_t recordBytes(size_t variables) {
  return sizeof(StepRecord) + variables * sizeof(StepValuesRecord);
}

template <typename Record>
void put(const Record& record, std::vector<std::byte>& out) {
  const size_t at = out.size();
  out.resize(at + sizeof record);
  std::memcpy(out.data() + at, &record, sizeof record);
}

void putStep(const SeriesStep& step, std::vector<std::byte>& out) {
  put(StepRecord{step.time, step.geometry, 0, step.geometry_checksum, step.grid_checksum}, out);
  for (const StepValues& values : step.values)
    put(StepValuesRecord{values.min, values.max, values.size, values.checksum}, out);
}

std::vector<std::byte> bytesOf(const Series& series, size_t variables) {
  std::vector<std::byte> bytes;
  StepsHeader header;
  header.variables = static_cast<uint32_t>(variables);
  put(header, bytes);
  for (const SeriesStep& step : series.steps) putStep(step, bytes);
  return bytes;
}

class StepsReader {
 public:
  StepsReader(fs::path path, const Manifest& manifest) : path_(std::move(path)), manifest_(manifest) {}

  Series read() {
    const FileInfo& info = listed();
    const InputFile file(path_);
    const uint64_t record = recordBytes(manifest_.variables.size());
    // What follows belongs to an addition that is under way or was interrupted.
    if (info.size > file.size()) refuse("is truncated", file.size(), info.size);
    const uint64_t steps = info.size < sizeof(StepsHeader) ? 0 : (info.size - sizeof(StepsHeader)) / record;
    if (steps == 0 || steps > kMaxSteps || sizeof(StepsHeader) + steps * record != info.size)
      throw Error(
          "{}: has {} bytes, which is not a whole number of steps; the cache is damaged: convert again",
          path_.string(), info.size);
    bytes_.resize(info.size);
    file.readAt(0, std::span(bytes_));
    if (const uint64_t found = checksumOf(bytes_); found != info.checksum)
      throw Error(
          "{}: has a wrong checksum (found {:016x}, expected {:016x}); the file is damaged: convert again",
          path_.string(), found, info.checksum);
    checkHeader();
    Series series;
    series.steps.reserve(steps);
    for (uint64_t step = 0; step < steps; ++step) series.add(stepAt(step, series));
    return series;
  }

 private:
  const FileInfo& listed() const {
    if (const FileInfo* const info = manifest_.file(kStepsFileName)) return *info;
    throw Error("{}: is not listed in the manifest; the cache is damaged: convert again", path_.string());
  }

  void checkHeader() const {
    StepsHeader header;
    std::memcpy(&header, bytes_.data(), sizeof header);
    if (header.magic != kMagic || header.version != 1)
      throw Error("{}: does not begin as a steps.bin of version 1; the cache is damaged: convert again",
                  path_.string());
    if (header.variables != manifest_.variables.size())
      refuse("has another number of variables", header.variables, manifest_.variables.size());
  }

  SeriesStep stepAt(uint64_t number, const Series& before) const {
    const std::byte* at =
        bytes_.data() + sizeof(StepsHeader) + number * recordBytes(manifest_.variables.size());
    StepRecord record;
    std::memcpy(&record, at, sizeof record);
    SeriesStep step{record.time, record.geometry, record.geometry_checksum, record.grid_checksum, {}};
    bool fine = std::isfinite(step.time) && step.geometry <= before.geometries() &&
                (before.steps.empty() || step.time > before.steps.back().time);
    if (before.steps.empty()) fine &= step.geometry == 0;
    step.values.resize(manifest_.variables.size());
    std::memcpy(step.values.data(), at + sizeof record, step.values.size() * sizeof(StepValuesRecord));
    constexpr double kLargest = std::numeric_limits<float>::max();
    for (const StepValues& values : step.values)
      fine &= values.min >= -kLargest && values.min <= values.max && values.max <= kLargest;
    if (!fine)
      throw Error("{}: step {} is invalid; the file is damaged or was written by another program",
                  path_.string(), number);
    return step;
  }

  [[noreturn]] void refuse(const char* what, uint64_t found, uint64_t expected) const {
    throw Error("{}: {} (found {}, expected {}); the cache is damaged: convert again", path_.string(), what,
                found, expected);
  }

  const fs::path path_;
  const Manifest& manifest_;
  std::vector<std::byte> bytes_;
};

/// The one step of a cache that is no series.
Series singleStep(const Manifest& manifest) {
  SeriesStep step{manifest.steps.front().time, 0, 0, manifest.grid_checksum.value_or(0), {}};
  for (const VariableInfo& variable : manifest.variables) {
    StepValues values{variable.min, variable.max, 0, 0};
    if (const FileInfo* const file = manifest.file(fmt::format("var.{}.bin", variable.number))) {
      values.size = file->size;
      values.checksum = file->checksum;
    }
    step.values.push_back(values);
  }
  Series series;
  series.add(std::move(step));
  return series;
}

}  // namespace

uint64_t Series::nearest(double time) const {
  const auto after = std::lower_bound(steps.begin(), steps.end(), time,
                                      [](const SeriesStep& step, double value) { return step.time < value; });
  if (after == steps.begin()) return 0;
  const auto before = after - 1;
  const bool is_after = after != steps.end() && after->time - time < time - before->time;
  return static_cast<uint64_t>((is_after ? after : before) - steps.begin());
}

StepPosition Series::between(double time) const {
  const auto after = std::upper_bound(steps.begin(), steps.end(), time,
                                      [](double value, const SeriesStep& step) { return value < step.time; });
  if (after == steps.begin()) return {};
  const auto step = static_cast<uint64_t>(after - steps.begin()) - 1;
  if (after == steps.end()) return {step};
  const double part = (time - steps[step].time) / (after->time - steps[step].time);
  return part < 1 ? StepPosition{step, part} : StepPosition{step + 1};
}

double Series::timeAt(const StepPosition& position) const {
  const double time = steps[position.step].time;
  return position.part > 0 ? time + position.part * (steps[position.step + 1].time - time) : time;
}

std::optional<uint32_t> Series::geometryOf(uint64_t grid_checksum) const {
  if (grid_checksum == 0) return std::nullopt;
  for (uint32_t geometry = geometries(); geometry-- > 0;)
    if (steps[first_steps[geometry]].grid_checksum == grid_checksum) return geometry;
  return std::nullopt;
}

void Series::add(SeriesStep step) {
  CURVISPLAT_CHECK_OP(step.geometry, <=, geometries());
  if (step.geometry == geometries()) first_steps.push_back(steps.size());
  steps.push_back(std::move(step));
}

void Series::cutTo(uint64_t count) {
  steps.resize(std::min<uint64_t>(count, steps.size()));
  std::erase_if(first_steps, [count](uint64_t step) { return step >= count; });
}

std::string geometryFolderName(uint32_t geometry) {
  return geometry == 0 ? "" : fmt::format("geometry.{}", geometry);
}

std::string stepValuesName(const Series& series, uint64_t step, uint32_t number) {
  return series.isFirstOfGeometry(step) ? fmt::format("var.{}.bin", number)
                                        : fmt::format("var.{}.{}.bin", number, step);
}

Series readSeries(const fs::path& cache, const Manifest& manifest) {
  if (!manifest.hasFeature(kSteps)) return singleStep(manifest);
  return StepsReader(cacheFile(cache, kStepsFileName), manifest).read();
}

FileInfo appendStep(const fs::path& cache, const Manifest& manifest, const Series& series) {
  const size_t variables = manifest.variables.size();
  const std::vector<std::byte> bytes = bytesOf(series, variables);
  // A cache that was no series may have the file of an addition that was interrupted.
  const bool anew = !manifest.hasFeature(kSteps);
  OutputFile file(cacheFile(cache, kStepsFileName), Caching::kPages,
                  anew ? OutputFile::Existing::kEmpty : OutputFile::Existing::kKeep);
  const uint64_t before = anew ? 0 : bytes.size() - recordBytes(variables);
  file.writeAt(before, std::span(bytes).subspan(before));
  file.truncate(bytes.size());
  file.close();
  return {kStepsFileName, bytes.size(), checksumOf(bytes)};
}

FileInfo stepsFileOf(const Series& series, size_t variables) {
  const std::vector<std::byte> bytes = bytesOf(series, variables);
  return {kStepsFileName, bytes.size(), checksumOf(bytes)};
}

uint64_t firstStepChecksum(const Series& series) {
  Series first = series;
  first.cutTo(1);
  return stepsFileOf(first, first.steps.front().values.size()).checksum;
}

void cutAppended(const fs::path& cache, const Manifest& manifest) noexcept {
  try {
    const fs::path path = cacheFile(cache, kStepsFileName);
    if (!manifest.hasFeature(kSteps)) removeFileIfThere(path);
    const FileInfo* const file = manifest.file(kStepsFileName);
    if (file && fs::file_size(path) > file->size)
      OutputFile(path, Caching::kPages, OutputFile::Existing::kKeep).truncate(file->size);
  } catch (...) {
    // The next addition cuts it.
  }
}

namespace {

/// " (did you mean out/flow.splats?)": a cache in the folder of one that is missing, whose name without folder and ending is
/// like its own; absolute or relative as its path is. Empty if there is none.
std::string meantBeside(const fs::path& cache) {
  constexpr size_t kMax = 1000;
  std::vector<std::string> stems;
  std::error_code error;
  const fs::path folder = cache.parent_path();
  for (fs::directory_iterator at(folder.empty() ? "." : folder, error), end;
       !error && at != end && stems.size() < kMax; at.increment(error))
    if (at->path().extension() == ".splats") stems.push_back(at->path().stem().string());
  const std::string close = closestTo(cache.stem().string(), stems);
  return close.empty() ? "" : fmt::format(" (did you mean {}?)", (folder / (close + ".splats")).string());
}

}  // namespace

Manifest readManifest(const fs::path& cache) {
  expectMirroredFile(cache / "manifest.json");
  if (!fs::exists(cache)) {
    if (hasUnfinished(cache))
      throw Error("{}: its conversion is unfinished; repeat the convert command with --resume to continue it",
                  cache.string());
    throw Error(
        "{}: does not exist{}; expected a splat cache (convert the grid first: curvisplat convert GRID -o "
        "{})",
        cache.string(), meantBeside(cache), cache.extension() == ".splats" ? cache.string() : "NAME.splats");
  }
  if (!fs::is_directory(cache))
    throw Error(
        "{}: is not a directory; expected a splat cache (convert the grid first: curvisplat convert GRID -o "
        "NAME.splats)",
        cache.string());
  if (!fs::exists(cache / "manifest.json"))
    throw Error(
        "{}: contains no manifest.json; expected a splat cache (convert the grid first: curvisplat convert "
        "GRID "
        "-o NAME.splats; repeat an interrupted conversion with --resume)",
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

namespace {

void requireChecksum(const fs::path& manifest, uint64_t found, uint64_t expected) {
  if (found != expected)
    throw Error(
        "{}: has a wrong checksum (found {:016x}, expected {:016x}); the cache is damaged: convert again",
        manifest.string(), found, expected);
}

/// The text of the manifest of a folder in a cache, which states its checksum.
std::string checkedText(const fs::path& manifest, uint64_t expected) {
  std::string text = readTextFile(manifest);
  requireChecksum(manifest, checksumOf(std::as_bytes(std::span(text))), expected);
  return text;
}

}  // namespace

std::string ownBlanksFolderName(size_t set) {
  return fmt::format("blanks.{}", set + 1);
}

fs::path ownBlanksFolder(const fs::path& cache, const Manifest& manifest, size_t set) {
  const fs::path folder = cacheFolder(cache, ownBlanksFolderName(set));
  const fs::path path = cacheFile(folder, "manifest.json");
  const uint64_t expected = manifest.own_blanks.at(set).checksum;
  if (manifest.hasFeature(kOwnBlanksOfSteps))
    requireChecksum(path, firstStepChecksum(readSeries(folder, readManifest(folder))), expected);
  else
    checkedText(path, expected);
  return folder;
}

std::shared_ptr<const GeometryFolder> GeometryFolder::open(const fs::path& cache, const Manifest& manifest,
                                                           const Series& series, uint32_t geometry) {
  if (geometry == 0) return std::make_shared<GeometryFolder>(cache, manifest);
  const fs::path folder = cacheFolder(cache, geometryFolderName(geometry));
  const fs::path path = cacheFile(folder, "manifest.json");
  Manifest of_folder = Manifest::fromJson(
      checkedText(path, series.steps[series.first_steps[geometry]].geometry_checksum), path);
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
