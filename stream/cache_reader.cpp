#include "stream/cache_reader.h"

#include <algorithm>
#include <cstring>

#include "stream/brick_codec.h"
#include "stream/cache_format.h"
#include "stream/cache_index.h"
#include "stream/checksum.h"
#include "stream/error.h"
#include "stream/file.h"
#include "stream/stage_timer.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

Manifest readManifest(const fs::path& cache) {
  if (!fs::exists(cache)) throw Error("{}: there is no such cache", cache.string());
  if (!fs::is_directory(cache)) throw Error("{}: is not a folder; a splat cache is one", cache.string());
  const fs::path path = cache / "manifest.json";
  if (!fs::exists(path))
    throw Error("{}: has no manifest.json: it is no splat cache, or one whose conversion was not finished",
                cache.string());
  return Manifest::fromJson(readTextFile(path), path);
}

}  // namespace

struct CacheReader::State {
  explicit State(const fs::path& cache)
      : path(cache), manifest(readManifest(cache)), geometry(cache / manifest.steps.front().geometry) {
    bricks = readBricks(path, manifest);
    checkFile(geometry, manifest);
    for (const VariableInfo& variable : manifest.variables) {
      values.emplace_back(path / variableFileName(variable));
      tables.push_back(readVariableTable(values.back(), manifest, bricks.size()));
    }
    checkFile(InputFile(path / "bricks.vdb"), manifest);
  }

  /// The bytes of a brick's stream, in the thread's scratch, verified.
  std::span<const std::byte> read(const InputFile& file, uint32_t brick, const Extent& extent,
                                  ReadTimes& times) const {
    const StageTimer timer(times.read_s);
    thread_local std::vector<std::byte> scratch;
    scratch.resize(extent.length);
    file.readAt(extent.offset, std::span(scratch));
    const uint64_t found = checksumOf(scratch);
    if (found != extent.checksum)
      throw Error(
          "{}: brick {} at offset {} ({} bytes) has the checksum {:016x}, expected {:016x}; the file is "
          "damaged: convert again",
          file.path().string(), brick, extent.offset, extent.length, found, extent.checksum);
    return scratch;
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
  if (variables.empty()) throw UsageError("{}: the cache has no scalar", path().string());
  throw UsageError("{}: the cache has no scalar '{}'; it has {}", path().string(), name, names);
}

void CacheReader::readGeometry(uint32_t brick, SplatGeometry& out, std::vector<NodeRun>* runs,
                               ReadTimes* times) const {
  ReadTimes ignored;
  ReadTimes& sums = times ? *times : ignored;
  CURVISPLAT_CHECK_OP(brick, <, state_->bricks.size());
  const Brick& record = state_->bricks[brick];
  const auto bytes = state_->read(state_->geometry, brick, record.geometry, sums);
  const StageTimer timer(sums.decode_s);
  try {
    decodeGeometry(state_->manifest.root, record, bytes, out, runs);
  } catch (const Error& error) {
    throw Error("{}: brick {}: {}", state_->geometry.path().string(), brick, error.what());
  }
}

void CacheReader::readVariable(uint32_t brick, size_t variable, SplatVariable& out, ReadTimes* times) const {
  ReadTimes ignored;
  ReadTimes& sums = times ? *times : ignored;
  CURVISPLAT_CHECK_OP(brick, <, state_->bricks.size());
  CURVISPLAT_CHECK_OP(variable, <, state_->tables.size());
  const BrickVariable& record = state_->tables[variable][brick];
  const auto bytes = state_->read(state_->values[variable], brick, record.values, sums);
  const StageTimer timer(sums.decode_s);
  try {
    decodeVariable(state_->bricks[brick], record, bytes, out);
  } catch (const Error& error) {
    throw Error("{}: brick {}: {}", state_->values[variable].path().string(), brick, error.what());
  }
}

}  // namespace curvisplat
