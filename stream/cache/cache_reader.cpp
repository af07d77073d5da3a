#include "stream/cache/cache_reader.h"

#include <algorithm>
#include <cstring>

#include "stream/base/check.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/stage_timer.h"
#include "stream/cache/cache_file.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/partial_folder.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

Manifest readManifest(const fs::path& cache) {
  if (!fs::exists(cache)) {
    if (hasUnfinished(cache))
      throw Error("{}: its conversion is unfinished; repeat the convert command with --resume to continue it",
                  cache.string());
    throw Error(
        "{}: does not exist; expected a splat cache (convert the grid first: curvisplat convert GRID -o {})",
        cache.string(), cache.string());
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

}  // namespace

struct CacheReader::State {
  explicit State(const fs::path& cache)
      : path(cache),
        manifest(readManifest(cache)),
        geometry(cacheFile(cache, manifest.steps.front().geometry)) {
    bricks = readBricks(path, manifest);
    checkFile(geometry, manifest);
    for (const VariableInfo& variable : manifest.variables) {
      values.emplace_back(cacheFile(path, variableFileName(variable)));
      tables.push_back(readVariableTable(values.back(), manifest, bricks));
    }
    checkGrids();
  }

  /// Only checks that bricks.vdb exists and has the right size. The reader does not need it, and OpenVDB's
  /// parser trusts its input.
  void checkGrids() const {
    const fs::path grids = cacheFile(path, "bricks.vdb");
    std::error_code error;
    const uint64_t bytes = fs::file_size(grids, error);
    if (error) throw Error("{}: {}; the cache is incomplete: convert again", grids.string(), error.message());
    checkFile(grids, bytes, manifest);
  }

  /// Reads a brick's stream into the thread's scratch.
  static std::span<const std::byte> read(const InputFile& file, uint32_t brick, const Extent& extent,
                                         ReadTimes& times) {
    const StageTimer timer(times.read_s);
    thread_local std::vector<std::byte> scratch;
    scratch.resize(extent.length);
    try {
      file.readAt(extent.offset, std::span(scratch));
    } catch (const TruncatedFile& error) {
      throw DamagedBrick("brick {} cannot be read: {}", brick, error.what());
    } catch (const Error& error) {
      throw Error("brick {} cannot be read: {}", brick, error.what());
    }
    return scratch;
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
    } catch (const Error& error) {
      throw DamagedBrick("{}: brick {}: {}", file.path().string(), brick, error.what());
    }
  }

  fs::path path;
  Manifest manifest;
  std::vector<Brick> bricks;
  InputFile geometry;
  std::vector<InputFile> values;                   // [variable]
  std::vector<std::vector<BrickVariable>> tables;  // [variable][brick]
};

CacheReader::CacheReader(const fs::path& cache) : state_(std::make_unique<State>(cache)) {}
CacheReader::~CacheReader() = default;
CacheReader::CacheReader(CacheReader&&) noexcept = default;
CacheReader& CacheReader::operator=(CacheReader&&) noexcept = default;

const fs::path& CacheReader::path() const {
  return state_->path;
}

const Manifest& CacheReader::manifest() const {
  return state_->manifest;
}

std::span<const Brick> CacheReader::bricks() const {
  return state_->bricks;
}

std::span<const BrickVariable> CacheReader::brickVariables(size_t variable) const {
  CURVISPLAT_CHECK_OP(variable, <, state_->tables.size());
  return state_->tables[variable];
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
  return state_->geometry.path();
}

const fs::path& CacheReader::valuesPath(size_t variable) const {
  CURVISPLAT_CHECK_OP(variable, <, state_->values.size());
  return state_->values[variable].path();
}

void CacheReader::readGeometry(uint32_t brick, SplatGeometry& out, std::vector<NodeRun>* runs,
                               ReadTimes* times) const {
  ReadTimes ignored;
  ReadTimes& sums = times ? *times : ignored;
  CURVISPLAT_CHECK_OP(brick, <, state_->bricks.size());
  const Brick& record = state_->bricks[brick];
  const auto bytes = State::read(state_->geometry, brick, record.geometry, sums);
  State::verify(state_->geometry, brick, record.geometry, bytes, sums);
  State::decode(state_->geometry, brick, sums,
                [&] { decodeGeometry(state_->manifest.root, record, bytes, out, runs); });
}

void CacheReader::readVariable(uint32_t brick, size_t variable, SplatVariable& out, ReadTimes* times) const {
  ReadTimes ignored;
  ReadTimes& sums = times ? *times : ignored;
  CURVISPLAT_CHECK_OP(brick, <, state_->bricks.size());
  CURVISPLAT_CHECK_OP(variable, <, state_->tables.size());
  const BrickVariable& record = state_->tables[variable][brick];
  const InputFile& file = state_->values[variable];
  const auto bytes = State::read(file, brick, record.values, sums);
  State::verify(file, brick, record.values, bytes, sums);
  State::decode(file, brick, sums, [&] { decodeVariable(state_->bricks[brick], record, bytes, out); });
}

void CacheReader::decode(uint32_t brick, std::span<const std::byte> geometry,
                         const GeometryArrays<float>& out, ReadTimes& times) const {
  CURVISPLAT_CHECK_OP(brick, <, state_->bricks.size());
  const Brick& record = state_->bricks[brick];
  State::verify(state_->geometry, brick, record.geometry, geometry, times);
  State::decode(state_->geometry, brick, times,
                [&] { decodeGeometry(state_->manifest.root, record, geometry, out); });
}

void CacheReader::decode(uint32_t brick, size_t variable, std::span<const std::byte> values,
                         const VariableArrays<float>& out, ReadTimes& times) const {
  CURVISPLAT_CHECK_OP(brick, <, state_->bricks.size());
  CURVISPLAT_CHECK_OP(variable, <, state_->tables.size());
  const InputFile& file = state_->values[variable];
  State::verify(file, brick, state_->tables[variable][brick].values, values, times);
  State::decode(file, brick, times, [&] { decodeVariable(state_->bricks[brick], values, out); });
}

}  // namespace curvisplat
