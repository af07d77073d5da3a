#include "stream/cache/cache_reader.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "stream/base/checksum.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/mutex.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/series.h"
#include "stream/cache/series_values.h"
#include "stream/codec/brick_codec.h"
#include "stream/codec/values_codec.h"

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

/// Returns device and inode, which tell a folder from another that takes its name. Zeros where there is no such folder, as of
/// a cache on a web server.
std::pair<uint64_t, uint64_t> identityOf(const fs::path& folder) {
  struct stat found {};
  if (::stat(folder.c_str(), &found) != 0) return {};
  return {found.st_dev, found.st_ino};
}

}  // namespace

/// A brick's values to be decoded, and what that costs and may use.
struct BrickOfVariable {
  uint32_t brick;
  size_t variable;
  ReadTimes& times;
  KeptValues* kept;

  KeptValues::Key at(uint64_t step) const { return {step, variable, brick}; }
};

struct CacheReader::State {
  State(const fs::path& cache_path, uint64_t number)
      : cache(cache_path),
        whole(cache_path),
        identity(identityOf(cache_path)),
        of_series(std::make_shared<const Manifest>(readManifest(cache_path))) {
    series = std::make_shared<const Series>(readSeries(cache, *of_series));
    open(number, nullptr);
  }

  State(const State& other, const StepPosition& wanted)
      : cache(other.cache),
        whole(other.whole),
        identity(other.identity),
        of_series(other.of_series),
        series(other.series) {
    opening([&] {
      open(wanted.step, &other);
      if (wanted.part > 0) blendWithNext(wanted.part);
    });
  }

  /// Runs `open_files`. If it fails since the cache is no longer there, the error says so.
  template <typename OpenFiles>
  void opening(const OpenFiles& open_files) const {
    try {
      open_files();
    } catch (const Error& error) {
      if (identityOf(cache) == identity) throw;
      throw Error("{}: has been replaced or removed since it was opened; open it again ({})", cache.string(),
                  error.what());
    }
  }

  void open(uint64_t number, const State* other) {
    if (number >= series->steps.size())
      throw Error("{}: has no step {}; it has {}", cache.string(), number,
                  series->steps.size() == 1 ? "one, which is step 0"
                                            : fmt::format("steps 0 to {}", series->steps.size() - 1));
    position = {number};
    const uint32_t geometry = series->steps[number].geometry;
    folder = other && other->series->steps[other->position.step].geometry == geometry
                 ? other->folder
                 : GeometryFolder::open(cache, *of_series, *series, geometry);
    manifest = manifestAtStep(*folder, *of_series, *series, number);
    for (size_t v = 0; v < manifest.variables.size(); ++v)
      values.push_back(folder->values(*series, number, v));
  }

  /// Keeps the steps that the whole cache has: another may be on its way into it.
  void keepStepsOf(const Series& of_whole) {
    auto kept = std::make_shared<Series>(*series);
    kept->cutTo(of_whole.steps.size());
    for (size_t step = 0; step < kept->steps.size(); ++step)
      if (kept->steps[step].time != of_whole.steps[step].time)
        throw Error("{}: step {} has the time {}, in {} {}; the cache is damaged: convert again",
                    cache.string(), step, kept->steps[step].time, whole.string(), of_whole.steps[step].time);
    series = std::move(kept);
  }

  void blendWithNext(double part) {
    next = std::make_unique<const State>(*this, StepPosition{position.step + 1});
    if (next->folder != folder)
      throw Error("{}: steps {} and {} have different grids; values between them cannot be interpolated",
                  cache.string(), position.step, position.step + 1);
    position.part = part;
    manifest.steps.front().time = series->timeAt(position);
    for (size_t v = 0; v < values.size(); ++v) {
      VariableInfo& variable = manifest.variables[v];
      const VariableInfo& later = next->manifest.variables[v];
      variable.min += part * (later.min - variable.min);
      variable.max += part * (later.max - variable.max);
      blended.emplace_back(values[v]->table);
      for (size_t brick = 0; brick < blended[v].size(); ++brick)
        blended[v][brick] = blendedRecord(values[v]->table[brick], next->values[v]->table[brick], part);
    }
  }

  /// Reads a brick's stream into the thread's scratch.
  static std::span<const std::byte> read(const InputFile& file, uint32_t brick, const Extent& extent,
                                         ReadTimes& times) {
    static const PerThread<std::vector<std::byte>> streams;
    std::vector<std::byte>& scratch = streams.own();
    scratch.resize(extent.length);
    readInto(file, brick, extent, scratch, times);
    return scratch;
  }

  static void readInto(const InputFile& file, uint32_t brick, const Extent& extent, std::span<std::byte> to,
                       ReadTimes& times) {
    const StageTimer timer(times.read_s, "read brick");
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
    const StageTimer timer(times.verify_s, "verify brick");
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
    const StageTimer timer(times.decode_s, "decode brick");
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
    const MutexLock lock(opening_earlier);
    auto& known = earlier[{at_step, variable}];
    if (!known) opening([&] { known = folder->values(*series, at_step, variable); });
    return known;
  }

  /// A stream of the step, verified.
  void decodeValues(const BrickOfVariable& of, std::span<const std::byte> stream,
                    const VariableArrays<float>& out) const;
  void readValues(const BrickOfVariable& of, SplatVariable& out) const;

  class ValuesDecoder;

  fs::path cache, whole;
  std::pair<uint64_t, uint64_t> identity;  // of the folder `cache` when it was opened
  std::shared_ptr<const Manifest> of_series;
  std::shared_ptr<const Series> series;
  StepPosition position;
  std::shared_ptr<const GeometryFolder> folder;
  Manifest manifest;                                      // at the position
  std::vector<std::shared_ptr<const ValuesFile>> values;  // [variable]
  std::unique_ptr<const State> next;                      // of a position between two steps: the later one
  std::vector<std::vector<BrickVariable>> blended;        // the tables there
  mutable Mutex opening_earlier;
  mutable std::map<std::pair<uint64_t, size_t>, std::shared_ptr<const ValuesFile>> earlier
      GUARDED_BY(opening_earlier);
};

/// Decodes a brick's values, with those of earlier steps that they are predicted from, each once.
class CacheReader::State::ValuesDecoder {
 public:
  ValuesDecoder(const State& state, const BrickOfVariable& of) : state_(state), of_(of) {}

  /// `stream`: that of step `of_step`, verified; it is in `file`.
  void decode(uint64_t of_step, const InputFile& file, std::span<const std::byte> stream,
              const VariableArrays<float>& out) {
    if (++streams_ > kMaxStreams) refuse(file, fmt::format("it needs more than {} streams", kMaxStreams));
    TimeReferences references;
    State::decode(file, of_.brick, of_.times, [&] {
      references.steps_back = stepsBackOf(stream);
      const char* const feature = featureOf(stream);
      if (feature && !state_.of_series->hasFeature(feature))
        throw Error(
            "its values use the feature '{}', which the manifest does not list; the cache is damaged: "
            "convert again",
            feature);
    });
    // The one further back first: the other may be predicted from it as well.
    for (const size_t n : {size_t{1}, size_t{0}})
      if (references.steps_back[n] > 0)
        references.values[n] = earlier(of_step, references.steps_back[n], file);
    State::decode(file, of_.brick, of_.times,
                  [&] { decodeVariable(state_.folder->bricks()[of_.brick], stream, out, references); });
  }

 private:
  struct Earlier {
    uint64_t step;
    KeptValues::Values values;
  };

  VariableArrays<const float> earlier(uint64_t of_step, uint64_t back, const InputFile& from) {
    const auto& steps = state_.series->steps;
    if (back > of_step || steps[of_step - back].geometry != steps[of_step].geometry)
      refuse(from, fmt::format("it is predicted from {} steps back, where its geometry has no step", back));
    const uint64_t at = of_step - back;
    for (const Earlier& known : earlier_)
      if (known.step == at) return arraysOf(*known.values);
    KeptValues::Values known = of_.kept ? of_.kept->find(of_.at(at)) : nullptr;
    if (!known) {
      known = read(at);
      if (of_.kept) of_.kept->keep(of_.at(at), known);
    }
    earlier_.push_back({at, std::move(known)});
    return arraysOf(*earlier_.back().values);
  }

  KeptValues::Values read(uint64_t at) {
    const auto file = state_.earlierValues(at, of_.variable);
    const Extent& extent = file->table[of_.brick].values;
    std::vector<std::byte> stream(extent.length);
    State::readInto(file->file, of_.brick, extent, stream, of_.times);
    State::verify(file->file, of_.brick, extent, stream, of_.times);
    auto decoded = std::make_shared<SplatVariable>();
    decoded->resize(state_.folder->bricks()[of_.brick].splats);
    decode(at, file->file, stream, arraysOf(*decoded));
    return decoded;
  }

  [[noreturn]] void refuse(const InputFile& file, const std::string& what) const {
    throw DamagedBrick("{}: brick {}: {}; the file is damaged: convert again", file.path().string(),
                       of_.brick, what);
  }

  const State& state_;
  const BrickOfVariable of_;
  size_t streams_ = 0;
  std::vector<Earlier> earlier_;
};

void CacheReader::State::decodeValues(const BrickOfVariable& of, std::span<const std::byte> stream,
                                      const VariableArrays<float>& out) const {
  const auto keep_copy = [&] {
    auto copy = std::make_shared<SplatVariable>();
    copy->resize(out.size());
    copyValues(out, arraysOf(*copy));
    of.kept->keep(of.at(position.step), std::move(copy));
  };
  const bool keeps = of.kept && of.kept->capacity() > 0;
  if (const auto known = keeps ? of.kept->find(of.at(position.step)) : nullptr) {
    copyValues(arraysOf(*known), out);
  } else {
    ValuesDecoder(*this, of).decode(position.step, values[of.variable]->file, stream, out);
    if (keeps) keep_copy();
  }
  if (!next) return;
  static const PerThread<SplatVariable> nexts;
  SplatVariable& later = nexts.own();
  next->readValues(of, later);
  blendValues(out, arraysOf(std::as_const(later)), position.part);
}

void CacheReader::State::readValues(const BrickOfVariable& of, SplatVariable& out) const {
  const InputFile& file = values[of.variable]->file;
  const Extent& extent = values[of.variable]->table[of.brick].values;
  const auto bytes = read(file, of.brick, extent, of.times);
  verify(file, of.brick, extent, bytes, of.times);
  out.resize(folder->bricks()[of.brick].splats);
  decodeValues(of, bytes, arraysOf(out));
}

CacheReader::CacheReader(const fs::path& cache, uint64_t step)
    : state_(std::make_unique<State>(cache, step)) {}
CacheReader CacheReader::ofScalar(const fs::path& cache, std::string_view name) {
  CacheReader reader(cache);
  const std::optional<size_t> set = reader.ownBlanksOf(name);
  return set ? reader.ownBlanks(*set) : std::move(reader);
}

std::optional<size_t> CacheReader::ownBlanksOf(std::string_view name) const {
  const auto is_named = [name](const std::string& variable) {
    return name == variable || name.starts_with(variable + " [");  // as `info` prints it
  };
  const std::vector<OwnBlanks>& sets = seriesManifest().own_blanks;
  for (size_t n = 0; n < sets.size(); ++n)
    if (std::ranges::any_of(sets[n].variables, is_named)) return n;
  return std::nullopt;
}

CacheReader CacheReader::ownBlanks(size_t set) const {
  CacheReader reader(ownBlanksFolder(cachePath(), seriesManifest(), set));
  reader.state_->whole = cachePath();
  reader.state_->keepStepsOf(series());
  const uint64_t steps = reader.series().steps.size();
  return reader.at(position().step < steps ? position() : StepPosition{steps - 1});
}

std::vector<std::string> CacheReader::allScalars() const {
  std::vector<std::string> names;
  for (const VariableInfo& variable : seriesManifest().variables) names.push_back(variable.name);
  for (const OwnBlanks& set : seriesManifest().own_blanks)
    names.insert(names.end(), set.variables.begin(), set.variables.end());
  return names;
}

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

const fs::path& CacheReader::wholePath() const {
  return state_->whole;
}

const Manifest& CacheReader::seriesManifest() const {
  return *state_->of_series;
}

const Series& CacheReader::series() const {
  return *state_->series;
}

const StepPosition& CacheReader::position() const {
  return state_->position;
}

CacheReader CacheReader::at(const StepPosition& position) const {
  return CacheReader(std::make_unique<State>(*state_, position));
}

bool CacheReader::sharesGeometryWith(const CacheReader& other) const {
  return state_->folder == other.state_->folder;
}

std::span<const Brick> CacheReader::bricks() const {
  return state_->folder->bricks();
}

std::span<const BrickVariable> CacheReader::brickVariables(size_t variable) const {
  CURVISPLAT_CHECK_OP(variable, <, state_->values.size());
  return state_->next ? state_->blended[variable] : state_->values[variable]->table;
}

size_t CacheReader::variableNamed(std::string_view name) const {
  const auto& variables = state_->manifest.variables;
  for (size_t n = 0; n < variables.size(); ++n)
    if (name.empty() || variables[n].name == name) return n;
  for (size_t n = 0; n < variables.size(); ++n)  // as `info` prints it
    if (!variables[n].unit.empty() && name == fmt::format("{} [{}]", variables[n].name, variables[n].unit))
      return n;
  const std::vector<std::string> names = allScalars();
  const std::span<const std::string> own(names.data(), variables.size());
  if (std::ranges::find(names, name) != names.end())
    throw UsageError("{}: {} has values at other samples than {}; it is drawn without them, by --scalar",
                     path().string(), name, listed(own));
  if (variables.empty()) throw UsageError("{}: the cache has no scalars", path().string());
  const std::string meant = didYouMean(name, names);
  const bool can_grow = meant.empty() && series().steps.size() == 1;
  throw UsageError(
      "{}: the cache has no scalar '{}'{}; it has {}{}", path().string(), name, meant, listed(names),
      can_grow ? fmt::format("; curvisplat convert GRID ... --add-scalar {} --to {} adds one that "
                             "the grid's files have or that can be computed",
                             name, path().string())
               : "");
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

void CacheReader::readVariable(uint32_t brick, size_t variable, SplatVariable& out, ReadTimes* times,
                               KeptValues* kept) const {
  ReadTimes ignored;
  CURVISPLAT_CHECK_OP(brick, <, state_->folder->bricks().size());
  CURVISPLAT_CHECK_OP(variable, <, state_->values.size());
  state_->readValues({brick, variable, times ? *times : ignored, kept}, out);
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
                         const VariableArrays<float>& out, ReadTimes& times, KeptValues* kept) const {
  CURVISPLAT_CHECK_OP(brick, <, state_->folder->bricks().size());
  CURVISPLAT_CHECK_OP(variable, <, state_->values.size());
  const ValuesFile& file = *state_->values[variable];
  State::verify(file.file, brick, file.table[brick].values, values, times);
  state_->decodeValues({brick, variable, times, kept}, values, out);
}

StreamErrors storedErrors(const CacheReader& reader, size_t variable) {
  const InputFile file(reader.valuesPath(variable));
  const std::span<const BrickVariable> table = reader.brickVariables(variable);
  StreamErrors of_all;
  double samples = 0;
  for (size_t n = 0; n < reader.bricks().size(); ++n) {
    const Brick& brick = reader.bricks()[n];
    if (!brick.isLeaf()) continue;
    std::array<std::byte, sizeof(ValuesHeader)> header{};
    const Extent& extent = table[n].values;
    file.readAt(extent.offset, std::span(header).first(std::min<size_t>(extent.length, header.size())));
    StreamErrors of_brick;
    try {
      of_brick = errorsOf(header, table[n].largest_slope);
    } catch (const Error& error) {
      throw DamagedBrick("{}: brick {}: {}; convert again", file.path().string(), n, error.what());
    }
    const auto add = [&](ValueErrors& sum, const ValueErrors& errors) {
      sum.largest = std::max(sum.largest, errors.largest);
      sum.typical += brick.splats * errors.typical * errors.typical;
    };
    add(of_all.means, of_brick.means);
    add(of_all.slopes, of_brick.slopes);
    samples += brick.splats;
  }
  for (ValueErrors* errors : {&of_all.means, &of_all.slopes})
    if (samples > 0) errors->typical = std::sqrt(errors->typical / samples);
  return of_all;
}

}  // namespace curvisplat
