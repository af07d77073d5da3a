// The time steps of a series, and the folders of their geometries. steps.bin has one record of fixed size
// per step, in the order of time, so that the manifest stays small. A step is added by appending its record
// and replacing the manifest, which states how many bytes of the file count. So readers of the old manifest
// see the old series, whatever follows.
//
//   steps.bin   StepsHeader | step x steps
//   step        StepRecord | StepValuesRecord x variables, in the order of the manifest's variables
//
// A *geometry* is a folder with the octree and the geometry streams of one or more steps: number 0 is the
// cache's own folder, number g > 0 is geometry.<g>/ in it, which is a cache of its first step by itself. The
// values of step s lie in its geometry's folder: in var.<n>.bin if s is the first step of that geometry,
// else in var.<n>.<s>.bin.
//
// 10,000 steps of four variables are 1.5 MB. Any thread may read a Series or use a GeometryFolder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/file.h"
#include "stream/base/mutex.h"
#include "stream/cache/manifest.h"
#include "stream/model/octree.h"

namespace curvisplat {

inline constexpr const char* kStepsFileName = "steps.bin";

/// A variable at a step.
struct StepValues {
  double min = 0, max = 0;          // of the samples, as in VariableInfo
  uint64_t size = 0, checksum = 0;  // of the file of values, as in FileInfo
};

/// A time step as steps.bin records it.
struct SeriesStep {
  double time = 0;  // increases from step to step
  uint32_t geometry = 0;
  uint64_t geometry_checksum = 0;  // of the manifest of its folder; 0 for geometry 0
  uint64_t grid_checksum = 0;      // as the manifest has it; 0: not known
  std::vector<StepValues> values;  // [variable]
};

/// A time of a series: that of a step, or one between it and the next.
struct StepPosition {
  uint64_t step = 0;
  double part = 0;  // of the way to the next step: 0 up to, but not including, 1
  bool operator==(const StepPosition&) const = default;
};

/// The steps of a cache. A cache without the feature `steps` has one.
struct Series {
  std::vector<SeriesStep> steps;
  std::vector<uint64_t> first_steps;  // [geometry]: its first step

  bool isFirstOfGeometry(uint64_t step) const { return first_steps[steps[step].geometry] == step; }
  uint32_t geometries() const { return static_cast<uint32_t>(first_steps.size()); }
  /// The step whose time is nearest; of two that are equally near the earlier.
  uint64_t nearest(double time) const;
  /// The place of `time` between the steps; the first or the last step if it is before or after all.
  StepPosition between(double time) const;
  double timeAt(const StepPosition& position) const;
  /// The geometry of the steps whose grid has this checksum.
  std::optional<uint32_t> geometryOf(uint64_t grid_checksum) const;
  /// Appends a step. Its geometry is one of those before or the next.
  void add(SeriesStep step);
  /// Removes the steps from number `count` on, at least one of which stays.
  void cutTo(uint64_t count);
};

/// "geometry.3", or "" for geometry 0.
std::string geometryFolderName(uint32_t geometry);
/// The name of the file of values of the variable with this number at a step.
std::string stepValuesName(const Series& series, uint64_t step, uint32_t number);

/// Reads the series of the cache in the folder `cache`. Throws Error if steps.bin is damaged or contradicts
/// the manifest. Costs one read and no allocation per value.
Series readSeries(const std::filesystem::path& cache, const Manifest& manifest);

/// Appends the last step of `series` to steps.bin and syncs the file, which is written anew if the manifest
/// does not list it. Cuts off what an interrupted addition has left after the size in the manifest. Returns
/// the manifest's entry.
FileInfo appendStep(const std::filesystem::path& cache, const Manifest& manifest, const Series& series);

/// The manifest's entry for steps.bin.
FileInfo stepsFileOf(const Series& series, size_t variables);

/// The checksum of the part of steps.bin that describes the first step, which further steps do not change. A
/// cache without steps.bin has the checksum that the file would have.
uint64_t firstStepChecksum(const Series& series);

/// Cuts off the records that appendStep() has appended and `manifest`, the cache's, does not list. If that
/// fails, they stay there without harm.
void cutAppended(const std::filesystem::path& cache, const Manifest& manifest) noexcept;

/// An open file of values: of one variable at one step.
struct ValuesFile {
  InputFile file;
  std::vector<BrickVariable> table;  // [brick]
};

/// The folder of a geometry of a cache: its octree and geometry streams, and the files of values of the
/// steps that share it. It is immutable, except for the list of open files of values: all readers of a step
/// share them as long as one of them is open.
class GeometryFolder {
 public:
  /// `manifest`: that of the folder. Throws Error if the tables are damaged.
  GeometryFolder(std::filesystem::path folder, Manifest manifest);
  /// The folder of a geometry of the cache with this manifest. Throws Error as the constructor, and if the
  /// folder is not the one that the series names.
  static std::shared_ptr<const GeometryFolder> open(const std::filesystem::path& cache,
                                                    const Manifest& manifest, const Series& series,
                                                    uint32_t geometry);

  const std::filesystem::path& path() const { return path_; }
  const Manifest& manifest() const { return manifest_; }
  const std::vector<Brick>& bricks() const { return bricks_; }
  const InputFile& geometry() const { return geometry_; }

  /// A variable of the manifest at a step of this geometry. Any thread. Throws Error if the file is damaged.
  std::shared_ptr<const ValuesFile> values(const Series& series, uint64_t step, size_t variable) const;

 private:
  std::filesystem::path path_;
  Manifest manifest_;
  std::vector<Brick> bricks_;
  InputFile geometry_;
  mutable Mutex opening_;
  mutable std::map<std::pair<uint64_t, size_t>, std::weak_ptr<const ValuesFile>> open_
      GUARDED_BY(opening_);  // [step, variable]
};

/// "blanks.1": the folder of Manifest::own_blanks[0].
std::string ownBlanksFolderName(size_t set);
/// The path of that folder in the folder `cache`, whose manifest is `manifest`. Throws Error if it is not the one that
/// `manifest` states.
std::filesystem::path ownBlanksFolder(const std::filesystem::path& cache, const Manifest& manifest,
                                      size_t set);

/// The manifest of the cache in the folder `cache`. Throws Error that says what the folder is instead.
Manifest readManifest(const std::filesystem::path& cache);

}  // namespace curvisplat
