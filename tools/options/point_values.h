// The files that a cache was made from, and what they have at points: exact where the cache has rounded means.
#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"
#include "preprocess/probe/source_probe.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The files that a cache names as its sources, as far as they are still there: as given, or beside the cache. Empty if
/// one is missing.
std::vector<std::filesystem::path> sourcesOf(const Manifest& manifest, const std::filesystem::path& cache);

/// Sets the files of `grid`: `files`, or those that the cache names, if there are none; of these the one that names the others, or
/// their case. Sets the globe as the cache has it, unless the options say. Throws Error if one of the files is missing, or if they
/// are those of a series, of which the step's have to be given.
void setSource(const CacheReader& reader, const std::vector<std::filesystem::path>& files,
               OpenGridOptions& grid);

/// Calls `open`, which opens the files of `options`. If these have the cache's time at another time step than the one that is
/// opened, and none was asked for, sets options.time_step and calls it again.
std::unique_ptr<DataSource> openStepOf(const Manifest& manifest, OpenGridOptions& options,
                                       const std::function<std::unique_ptr<DataSource>()>& open);

/// The source of exact values, beside a cache.
struct PointSource {
  OpenGridOptions grid;  // with its files
  GasModel gas;
};

/// The grid that a cache was made from, opened.
struct OpenSource {
  std::unique_ptr<DataSource> grid;
  std::vector<uint32_t> scalars;   // [scalar of the cache] in the grid's description
  std::vector<ValueRange> ranges;  // [scalar of the cache] of its values: samples beyond are not in the cache
};

/// Throws Error as reading does, and if the source is not the grid of the cache.
OpenSource openSource(const CacheReader& reader, const PointSource& source);

/// The values at a point.
struct PointValues {
  uint32_t block = 0;  // of the nearest sample: a node or a cell; block, i, j and k count from 0
  uint64_t i = 0, j = 0, k = 0;
  glm::dvec3 place{
      0.0};  // the middle of the sample's cell; from a source that of the cell or the node itself
  std::vector<double> values;  // [scalar of the cache], at the point
  std::vector<double> sample;  // and at `place`
  double distance = 0;         // ProbeResult::distance
};

/// The values at each point, from the cache or, with a source, from the grid's own cell there; nullopt
/// outside of the data. Throws Error as reading does, and if the source is not the grid of the cache. Sets `doubt`, if given,
/// to a text if the source has other values there than the cache, as the files of another time step have.
std::vector<std::optional<PointValues>> valuesAt(const CacheReader& reader,
                                                 std::span<const glm::dvec3> points,
                                                 const PointSource* source, std::string* doubt = nullptr);

/// The values of a set of scalars (a cache's own, or CacheReader::ownBlanks()) at points: valuesAt().
struct SetValues {
  const CacheReader* reader = nullptr;
  const PointSource* source = nullptr;
  std::vector<std::optional<PointValues>> found;  // [point]
  bool has_ended = false;                         // before the step that is asked for: it has no values
};

/// The values of several sets at the same points, with the scalars of all. The sample and its place are those
/// of the first set that has values at the point; PointValues::sample has what the others have at that place.
/// NaN: a scalar has no value there.
std::vector<std::optional<PointValues>> joinedValues(std::span<const SetValues> sets);

}  // namespace curvisplat
