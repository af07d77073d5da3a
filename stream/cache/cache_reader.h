// CacheReader opens a splat cache at a time step and reads bricks. It shows the cache as if it had that step
// alone, or, between two steps, as if it were made of the blended samples (series_values.h). Opening reads
// the manifest and the tables, and checks every size against the real files and every link of the octree. It
// never reads payloads (streams). An open CacheReader is immutable: any number of threads may read.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stream/base/error.h"
#include "stream/cache/manifest.h"
#include "stream/cache/series.h"
#include "stream/cache/series_values.h"
#include "stream/codec/values_codec.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Seconds spent on reading bricks, by stage. Each read adds to them.
struct ReadTimes {
  double read_s = 0;  // reading the file
  double verify_s = 0, decode_s = 0;
};

/// A brick's bytes differ from what was written: the file is damaged or has become shorter. A coarser brick
/// can be drawn instead. (If the disk itself fails, reading other bricks will probably fail as well: that is
/// a plain Error.)
class DamagedBrick : public Error {
 public:
  using Error::Error;
};

/// An open cache at a step, or between two.
class CacheReader {
 public:
  /// Opens the cache at a step, the first unless told otherwise. Throws an Error that names the file, what
  /// was found and what was expected.
  explicit CacheReader(const std::filesystem::path& cache, uint64_t step = 0);
  /// Opens the cache with the scalar `name`, at its first step: `cache`, or the cache inside it if the scalar
  /// has values at samples of its own (Manifest::own_blanks). If `name` is empty or unknown it opens `cache`.
  /// Throws Error as the constructor does.
  static CacheReader ofScalar(const std::filesystem::path& cache, std::string_view name);
  /// The index in seriesManifest().own_blanks of the set with the scalar `name`, which its unit may follow
  /// ("T [K]"); nullopt if no set has it.
  std::optional<size_t> ownBlanksOf(std::string_view name) const;
  /// Opens the cache of the scalars in seriesManifest().own_blanks[set] at this reader's position, or at its
  /// last step if the set ends earlier (addStep()). It shows no steps that this cache lacks. Throws Error as
  /// the constructor does.
  CacheReader ownBlanks(size_t set) const;
  /// The names of all scalars: of the cache's own, then of each set of seriesManifest().own_blanks.
  std::vector<std::string> allScalars() const;
  ~CacheReader();
  CacheReader(CacheReader&&) noexcept;
  CacheReader& operator=(CacheReader&&) noexcept;

  /// The folder of the step's geometry: the cache's own, unless the series has several.
  const std::filesystem::path& path() const;
  /// The manifest as a cache of this step alone would have it.
  const Manifest& manifest() const;

  /// The folder of the cache, and its manifest as it is there: of the whole series.
  const std::filesystem::path& cachePath() const;
  const Manifest& seriesManifest() const;
  const Series& series() const;
  /// The folder of the cache that this one was opened from by ofScalar() or ownBlanks(); cachePath() otherwise.
  const std::filesystem::path& wholePath() const;
  /// The number of the step; between two steps, that of the earlier one.
  uint64_t step() const { return position().step; }
  const StepPosition& position() const;
  double time() const { return series().timeAt(position()); }
  /// Opens the same cache at another step. Shares the geometry's tables if both steps have the same geometry.
  /// Throws Error as the constructor does.
  CacheReader atStep(uint64_t step) const { return at({step}); }
  /// Opens the same cache at a step, or between two: then extents and streams are those of the earlier one.
  /// Throws Error as the constructor does, and if the two steps have different geometries.
  CacheReader at(const StepPosition& position) const;
  /// Whether the bricks and geometry streams of both are the same ones.
  bool sharesGeometryWith(const CacheReader& other) const;

  /// The octree, level by level. The root is brick 0, or the first few bricks if several share the root
  /// cell.
  std::span<const Brick> bricks() const;
  /// [brick]: the table of manifest().variables[variable].
  std::span<const BrickVariable> brickVariables(size_t variable) const;

  /// The index in manifest().variables of the variable `name`, which its unit may follow ("T [K]"); 0 for
  /// the empty name. Throws a UsageError that lists the names if there is none, and says where a name of own_blanks is.
  size_t variableNamed(std::string_view name) const;

  /// Reads, verifies and decodes a brick. Throws DamagedBrick if the checksum does not match, the file ends
  /// early or the stream does not decode, and Error if the disk fails; both name the brick and the file.
  void readGeometry(uint32_t brick, SplatGeometry& out, std::vector<NodeRun>* runs = nullptr,
                    ReadTimes* times = nullptr) const;
  /// Reads the values of a brick in the same way. `kept`: decoded values of this cache's steps, which are
  /// used where they help, and added to; null: none.
  void readVariable(uint32_t brick, size_t variable, SplatVariable& out, ReadTimes* times = nullptr,
                    KeptValues* kept = nullptr) const;

  /// The payload files, for callers that read streams themselves.
  const std::filesystem::path& geometryPath() const;
  const std::filesystem::path& valuesPath(size_t variable) const;
  /// Verifies and decodes a stream that the caller has read: the bytes at bricks()[brick].geometry, or those
  /// at brickVariables(variable)[brick].values. The arrays in `out` have one element for each splat of the
  /// brick. Values of earlier steps, from which these are predicted, are read by the calling thread. Throws
  /// as readGeometry() does.
  void decode(uint32_t brick, std::span<const std::byte> geometry, const GeometryArrays<float>& out,
              ReadTimes& times) const;
  void decode(uint32_t brick, size_t variable, std::span<const std::byte> values,
              const VariableArrays<float>& out, ReadTimes& times, KeptValues* kept = nullptr) const;

 private:
  struct State;
  explicit CacheReader(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// The errors of the stored means and slopes of a scalar at the reader's step, in the scalar's unit: the
/// largest, and the typical one (the root mean square for values near the centre of its spread). Rounding to
/// a float adds to them. Reads 40 bytes of each leaf. Throws DamagedBrick if they cannot be decoded, Error if
/// the disk fails.
StreamErrors storedErrors(const CacheReader& reader, size_t variable);

}  // namespace curvisplat
