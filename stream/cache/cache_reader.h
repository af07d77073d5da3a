// Opens a splat cache and reads bricks. Opening reads the manifest and the tables, checks every size against
// the real files and every link of the octree; it never reads payloads. After that a CacheReader is
// immutable: any number of threads may read.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "stream/base/error.h"
#include "stream/cache/manifest.h"
#include "stream/model/brick.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Where reading bricks spends its time; added to.
struct ReadTimes {
  double read_s = 0;  // the disk's
  double verify_s = 0, decode_s = 0;
};

/// A brick's bytes are not what was written: the file is damaged, or has become shorter. A coarser brick can
/// stand in. (Where the disk itself fails, the others will fare no better: that is a plain Error.)
class DamagedBrick : public Error {
 public:
  using Error::Error;
};

class CacheReader {
 public:
  /// Throws Error naming the file, what was expected and what was found.
  explicit CacheReader(const std::filesystem::path& cache);
  ~CacheReader();
  CacheReader(CacheReader&&) noexcept;
  CacheReader& operator=(CacheReader&&) noexcept;

  const std::filesystem::path& path() const;
  const Manifest& manifest() const;

  /// The octree, level by level, root (brick 0, or the root's consecutive bricks) first.
  std::span<const Brick> bricks() const;
  /// [brick], for the variable at `variable` of manifest().variables.
  std::span<const BrickVariable> brickVariables(size_t variable) const;

  /// Position in manifest().variables of the variable `name`; the empty name is the first. Throws UsageError
  /// that lists the names there are.
  size_t variableNamed(std::string_view name) const;

  /// Reads, verifies and decodes. Throws DamagedBrick where a checksum does not match or the file ends, Error
  /// where the disk fails; both name the brick and the file.
  void readGeometry(uint32_t brick, SplatGeometry& out, std::vector<NodeRun>* runs = nullptr,
                    ReadTimes* times = nullptr) const;
  void readVariable(uint32_t brick, size_t variable, SplatVariable& out, ReadTimes* times = nullptr) const;

  /// Where the streams are, for who reads them himself.
  const std::filesystem::path& geometryPath() const;
  const std::filesystem::path& valuesPath(size_t variable) const;
  /// Verifies and decodes such bytes: those of bricks()[brick].geometry, those of the variable's values.
  /// Arrays of as many elements as the brick has splats. Throws as reading does.
  void decode(uint32_t brick, std::span<const std::byte> geometry, const GeometryArrays<float>& out,
              ReadTimes& times) const;
  void decode(uint32_t brick, size_t variable, std::span<const std::byte> values,
              const VariableArrays<float>& out, ReadTimes& times) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
