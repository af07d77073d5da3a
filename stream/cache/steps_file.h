// steps.bin: the time steps of a series, so that the manifest stays small. One record of fixed size per step, in
// the order of time; a step is added by appending its record and replacing the manifest, which states how many
// bytes of the file count. So readers of the old manifest see the old series, whatever follows.
//
//   steps.bin   StepsHeader | step x steps
//   step        StepRecord | StepValuesRecord x variables, in the order of the manifest's variables
//
// A *geometry* is a folder with the octree and the geometry streams of one or more steps: number 0 is the cache's
// own folder, number g > 0 is geometry.<g>/ in it, which is a cache of its first step by itself. The values of
// step s lie in its geometry's folder: in var.<n>.bin if s is the first step of that geometry, else in
// var.<n>.<s>.bin.
//
// 10,000 steps of four variables are 1.5 MB.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

inline constexpr const char* kStepsFileName = "steps.bin";

/// A variable at a step.
struct StepValues {
  double min = 0, max = 0;          // of the samples, as in VariableInfo
  uint64_t size = 0, checksum = 0;  // of the file of values, as in FileInfo
};

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

/// The steps of a cache. One without the feature `steps` has one.
struct Series {
  std::vector<SeriesStep> steps;
  std::vector<uint64_t> first_steps;  // [geometry]: its first step

  bool isFirstOfGeometry(uint64_t step) const { return first_steps[steps[step].geometry] == step; }
  uint32_t geometries() const { return static_cast<uint32_t>(first_steps.size()); }
  /// The step whose time is nearest; of two that are equally near the earlier.
  uint64_t nearest(double time) const;
  /// Where `time` lies between the steps; the first or the last step if it is before or after all.
  StepPosition between(double time) const;
  double timeAt(const StepPosition& position) const;
  /// The geometry of the steps whose grid has this checksum.
  std::optional<uint32_t> geometryOf(uint64_t grid_checksum) const;
  /// Appends a step. Its geometry is one of those before or the next.
  void add(SeriesStep step);
};

/// "geometry.3", or "" for geometry 0.
std::string geometryFolderName(uint32_t geometry);
/// The name of the file of values of the variable with this number at a step.
std::string stepValuesName(const Series& series, uint64_t step, uint32_t number);

/// Reads the series of the cache in the folder `cache`. Throws Error if steps.bin is damaged or contradicts the
/// manifest. Costs one read and no allocation per value.
Series readSeries(const std::filesystem::path& cache, const Manifest& manifest);

/// Appends the last step of `series` to steps.bin, which it writes anew where the manifest does not list it, and
/// syncs it. Cuts what an interrupted addition has left behind the manifest's size. Returns the manifest's entry.
FileInfo appendStep(const std::filesystem::path& cache, const Manifest& manifest, const Series& series);

/// Cuts what appendStep() has appended and no manifest lists. `manifest`: the cache's. If that fails it stays there without harm.
void cutAppended(const std::filesystem::path& cache, const Manifest& manifest) noexcept;

}  // namespace curvisplat
