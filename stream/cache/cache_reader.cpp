#include "stream/cache/cache_reader.h"

#include <algorithm>
#include <map>
#include <utility>

#include "stream/base/check.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/mutex.h"
#include "stream/base/stage_timer.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/geometry_folder.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// The most streams that are decoded for the values of a brick: its own and those that it is predicted from.
constexpr size_t kMaxStreams = 3;

Manifest manifestAtStep(const GeometryFolder& folder, const Manifest& of_series, const Series& series,
                        uint64_t step) {
  if (!of_series.hasFeature(kSteps)) return folder.manifest();
  Manifest manifest = folder.manifest();
  std::erase(manifest.requirements, kSteps);
  manifest.steps.front().time = series.steps[step].time;
  std::erase_if(manifest.files, [](const FileInfo& file) {
    return file.name == kStepsFileName || file.name.starts_with("var.");
  });
  for (size_t v = 0; v < manifest.variables.size(); ++v) {
    VariableInfo& variable = manifest.variables[v];
    const StepValues& values = series.steps[step].values[v];
    variable.min = values.min;
    variable.max = values.max;
    manifest.files.push_back({stepValuesName(series, step, variable.number), values.size, values.checksum});
  }
  return manifest;
}

}  // namespace

struct CacheReader::State {
  State(const fs::path& cache_path, uint64_t number)
      : cache(cache_path), of_series(std::make_shared<const Manifest>(readManifest(cache_path))) {
    series = std::make_shared<const Series>(readSeries(cache, *of_series));
    open(number, nullptr);
  }

  State(const State& other, uint64_t number)
      : cache(other.cache), of_series(other.of_series), series(other.series) {
    open(number, &other);
  }

  void open(uint64_t number, const State* other) {
    if (number >= series->steps.size())
      throw Error("{}: has no step {}; it has {}", cache.string(), number,
                  series->steps.size() == 1 ? "one, which is step 0"
                                            : fmt::format("steps 0 to {}", series->steps.size() - 1));
    step = number;
    const uint32_t geometry = series->steps[step].geometry;
    folder = other && other->series->steps[other->step].geometry == geometry
                 ? other->folder
                 : GeometryFolder::open(cache, *of_series, *series, geometry);
    manifest = manifestAtStep(*folder, *of_series, *series, step);
    for (size_t v = 0; v < manifest.variables.size(); ++v) values.push_back(folder->values(*series, step, v));
  }

  /// Reads a brick's stream into the thread's scratch.
  static std::span<const std::byte> read(const InputFile& file, uint32_t brick, const Extent& extent,
                                         ReadTimes& times) {
    thread_local std::vector<std::byte> scratch;
    scratch.resize(extent.length);
    readInto(file, brick, extent, scratch, times);
    return scratch;
  }

  static void readInto(const InputFile& file, uint32_t brick, const Extent& extent, std::span<std::byte> to,
                       ReadTimes& times) {
    const StageTimer timer(times.read_s);
    try {
      file.readAt(extent.offset, to);
    } catch (const TruncatedFile& error) {
      throw DamagedBrick("brick {} cannot be read: {}", brick, error.what());
    } catch (const Error& error) {
      throw Error("brick {} cannot be read: {}", brick, error.what());
    }
  }

  static void verify(const InputFile& file, uint32_t brick, const Extent& extent,
                     std::span<const std::byte> bytes, ReadTimes& times) {
    const StageTimer timer(times.verify_s);
    CURVISPLAT_CHECK_OP(bytes.size(), ==, extent.length);
    const uint64_t found = checksumOf(bytes);
    if (found != extent.checksum)
      throw DamagedBrick(
          "{}: brick {} at offset {} ({} bytes) has a wrong checksum (found {:016x}, expected {:016x}); the "
          "file is damaged: convert again",
          file.path().string(), brick, extent.offset, extent.length, found, extent.checksum);
  }

  /// Runs `work`, which decodes a verified stream, and prefixes its errors with file and brick.
  template <typename Work>
  static void decode(const InputFile& file, uint32_t brick, ReadTimes& times, const Work& work) {
    const StageTimer timer(times.decode_s);
    try {
      work();
    } catch (const DamagedBrick&) {
      throw;
    } catch (const Error& error) {
      throw DamagedBrick("{}: brick {}: {}", file.path().string(), brick, error.what());
    }
  }

  /// The values of a variable at an earlier step, kept open from then on. Any thread.
  std::shared_ptr<const ValuesFile> earlierValues(uint64_t at_step, size_t variable) const {
    const MutexLock lock(opening);
    auto& known = earlier[{at_step, variable}];
    if (!known) known = folder->values(*series, at_step, variable);
    return known;
  }

  class ValuesDecoder;

  fs::path cache;
  std::shared_ptr<const Manifest> of_series;
  std::shared_ptr<const Series> series;
  uint64_t step = 0;
  std::shared_ptr<const GeometryFolder> folder;
  Manifest manifest;                                      // of the step
  std::vector<std::shared_ptr<const ValuesFile>> values;  // [variable]
  mutable Mutex opening;
  mutable std::map<std::pair<uint64_t, size_t>, std::shared_ptr<const ValuesFile>> earlier
      GUARDED_BY(opening);
};

/// Decodes a brick's values, with those of earlier steps that they are predicted from, each once.
class CacheReader::State::ValuesDecoder {
 public:
  ValuesDecoder(const State& state, uint32_t brick, size_t variable, ReadTimes& times)
      : state_(state), brick_(brick), variable_(variable), times_(times) {}

  /// `stream`: that of step `of_step`, verified; it is in `file`.
  void decode(uint64_t of_step, const InputFile& file, std::span<const std::byte> stream,
              const VariableArrays<float>& out) {
    if (++streams_ > kMaxStreams) refuse(file, fmt::format("it needs more than {} streams", kMaxStreams));
    TimeReferences references;
    State::decode(file, brick_, times_, [&] { references.steps_back = stepsBackOf(stream); });
    // The one further back first: the other may be predicted from it as well.
    for (const size_t n : {size_t{1}, size_t{0}})
      if (references.steps_back[n] > 0)
        references.values[n] = earlier(of_step, references.steps_back[n], file);
    State::decode(file, brick_, times_,
                  [&] { decodeVariable(state_.folder->bricks()[brick_], stream, out, references); });
  }

 private:
  struct Earlier {
    uint64_t step;
    SplatVariable values;
  };

  VariableArrays<const float> earlier(uint64_t of_step, uint64_t back, const InputFile& from) {
    const auto& steps = state_.series->steps;
    if (back > of_step || steps[of_step - back].geometry != steps[of_step].geometry)
      refuse(from, fmt::format("it is predicted from {} steps back, where its geometry has no step", back));
    const uint64_t at = of_step - back;
    for (const auto& known : earlier_)
      if (known->step == at) return arraysOf(std::as_const(known->values));
    const auto file = state_.earlierValues(at, variable_);
    const Extent& extent = file->table[brick_].values;
    std::vector<std::byte> stream(extent.length);
    State::readInto(file->file, brick_, extent, stream, times_);
    State::verify(file->file, brick_, extent, stream, times_);
    auto decoded = std::make_unique<Earlier>(Earlier{at, {}});
    decoded->values.resize(state_.folder->bricks()[brick_].splats);
    decode(at, file->file, stream, arraysOf(decoded->values));
    earlier_.push_back(std::move(decoded));
    return arraysOf(std::as_const(earlier_.back()->values));
  }

  [[noreturn]] void refuse(const InputFile& file, const std::string& what) const {
    throw DamagedBrick("{}: brick {}: {}; the file is damaged: convert again", file.path().string(), brick_,
                       what);
  }

  const State& state_;
  const uint32_t brick_;
  const size_t variable_;
  ReadTimes& times_;
  size_t streams_ = 0;
  std::vector<std::unique_ptr<Earlier>> earlier_;
};

CacheReader::CacheReader(const fs::path& cache, uint64_t step)
    : state_(std::make_unique<State>(cache, step)) {}
CacheReader::CacheReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
CacheReader::~CacheReader() = default;
CacheReader::CacheReader(CacheReader&&) noexcept = default;
CacheReader& CacheReader::operator=(CacheReader&&) noexcept = default;

const fs::path& CacheReader::path() const {
  return state_->folder->path();
}

const Manifest& CacheReader::manifest() const {
  return state_->manifest;
}

const fs::path& CacheReader::cachePath() const {
  return state_->cache;
}

const Manifest& CacheReader::seriesManifest() const {
  return *state_->of_series;
}

const Series& CacheReader::series() const {
  return *state_->series;
}

uint64_t CacheReader::step() const {
  return state_->step;
}

CacheReader CacheReader::atStep(uint64_t step) const {
  return CacheReader(std::make_unique<State>(*state_, step));
}

bool CacheReader::sharesGeometryWith(const CacheReader& other) const {
  return state_->folder == other.state_->folder;
}

std::span<const Brick> CacheReader::bricks() const {
  return state_->folder->bricks();
}

std::span<const BrickVariable> CacheReader::brickVariables(size_t variable) const {
  CURVISPLAT_CHECK_OP(variable, <, state_->values.size());
  return state_->values[variable]->table;
}

size_t CacheReader::variableNamed(std::string_view name) const {
  const auto& variables = state_->manifest.variables;
  std::string names;
  for (size_t n = 0; n < variables.size(); ++n) {
    if (name.empty() || variables[n].name == name) return n;
    names += (n ? ", " : "") + variables[n].name;
  }
  if (variables.empty()) throw UsageError("{}: the cache has no scalars", path().string());
  throw UsageError("{}: the cache has no scalar '{}'; it has {}", path().string(), name, names);
}

const fs::path& CacheReader::geometryPath() const {
  return state_->folder->geometry().path();
}

const fs::path& CacheReader::valuesPath(size_t variable) const {
  CURVISPLAT_CHECK_OP(variable, <, state_->values.size());
  return state_->values[variable]->file.path();
}

void CacheReader::readGeometry(uint32_t brick, SplatGeometry& out, std::vector<NodeRun>* runs,
                               ReadTimes* times) const {
  ReadTimes ignored;
  ReadTimes& sums = times ? *times : ignored;
  CURVISPLAT_CHECK_OP(brick, <, state_->folder->bricks().size());
  const Brick& record = state_->folder->bricks()[brick];
  const auto bytes = State::read(state_->folder->geometry(), brick, record.geometry, sums);
  State::verify(state_->folder->geometry(), brick, record.geometry, bytes, sums);
  State::decode(state_->folder->geometry(), brick, sums,
                [&] { decodeGeometry(state_->manifest.root, record, bytes, out, runs); });
}

void CacheReader::readVariable(uint32_t brick, size_t variable, SplatVariable& out, ReadTimes* times) const {
  ReadTimes ignored;
  ReadTimes& sums = times ? *times : ignored;
  CURVISPLAT_CHECK_OP(brick, <, state_->folder->bricks().size());
  CURVISPLAT_CHECK_OP(variable, <, state_->values.size());
  const BrickVariable& record = state_->values[variable]->table[brick];
  const InputFile& file = state_->values[variable]->file;
  const auto bytes = State::read(file, brick, record.values, sums);
  State::verify(file, brick, record.values, bytes, sums);
  out.resize(state_->folder->bricks()[brick].splats);
  State::ValuesDecoder(*state_, brick, variable, sums).decode(state_->step, file, bytes, arraysOf(out));
}

void CacheReader::decode(uint32_t brick, std::span<const std::byte> geometry,
                         const GeometryArrays<float>& out, ReadTimes& times) const {
  CURVISPLAT_CHECK_OP(brick, <, state_->folder->bricks().size());
  const Brick& record = state_->folder->bricks()[brick];
  State::verify(state_->folder->geometry(), brick, record.geometry, geometry, times);
  State::decode(state_->folder->geometry(), brick, times,
                [&] { decodeGeometry(state_->manifest.root, record, geometry, out); });
}

void CacheReader::decode(uint32_t brick, size_t variable, std::span<const std::byte> values,
                         const VariableArrays<float>& out, ReadTimes& times) const {
  CURVISPLAT_CHECK_OP(brick, <, state_->folder->bricks().size());
  CURVISPLAT_CHECK_OP(variable, <, state_->values.size());
  const InputFile& file = state_->values[variable]->file;
  State::verify(file, brick, state_->values[variable]->table[brick].values, values, times);
  State::ValuesDecoder(*state_, brick, variable, times).decode(state_->step, file, values, out);
}

}  // namespace curvisplat
