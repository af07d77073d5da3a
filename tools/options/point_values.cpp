#include "tools/options/point_values.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <system_error>

#include "preprocess/formats/common/temporary_folder.h"
#include "preprocess/mesh/mesh_source.h"
#include "preprocess/probe/source_probe.h"
#include "stream/base/error.h"
#include "stream/base/text.h"
#include "stream/cache/probe.h"
#include "tools/options/convert_arguments.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOtherGrid = "is not the grid that the cache was made from";

void requireSameBlocks(const CacheReader& reader, const GridDescription& description,
                       const OpenGridOptions& grid) {
  const auto& expected = reader.manifest().blocks;
  const auto& blocks = description.blocks;
  bool same = blocks.size() == expected.size();
  for (size_t n = 0; same && n < blocks.size(); ++n)
    same = reader.manifest().refinement.nodeInFiles(
               n, {expected[n].ni - 1, expected[n].nj - 1, expected[n].nk - 1}) ==
           std::array{blocks[n].ni - 1, blocks[n].nj - 1, blocks[n].nk - 1};
  if (!same) throw Error("{}: {}", grid.grid.string(), kOtherGrid);
}

void requireSameSamples(const CacheReader& reader, const GridDescription& description,
                        const OpenGridOptions& grid) {
  uint64_t samples = 0;
  for (const MeshPiece& piece : description.pieces)
    samples += reader.manifest().cells ? piece.cells : piece.points;
  if (reader.manifest().blocks.size() != 1 || reader.manifest().blocks[0].ni != samples)
    throw Error("{}: {}", grid.grid.string(), kOtherGrid);
}

/// The grid's scalars like those of the cache, by name, of the cache's centring.
std::vector<uint32_t> scalarsLike(const CacheReader& reader, const GridDescription& description,
                                  const OpenGridOptions& grid) {
  const Centring centring = reader.manifest().cells ? Centring::kCell : Centring::kNode;
  std::vector<uint32_t> scalars;
  for (const VariableInfo& variable : reader.manifest().variables) {
    uint32_t n = 0;
    while (n < description.scalars.size() &&
           (description.scalars[n].name != variable.name || description.scalars[n].centring != centring))
      ++n;
    if (n == description.scalars.size())
      throw Error("{}: has no scalar {}; give all files of the grid", grid.grid.string(), variable.name);
    scalars.push_back(n);
  }
  return scalars;
}

/// Sets how longitude and latitude became positions as the cache has it, unless the options say.
void setGlobe(const Manifest& manifest, GlobeOptions& options) {
  if (!manifest.globe || options.shape != GlobeOptions::Shape::kAutomatic) return;
  const Globe& globe = *manifest.globe;
  if (globe.degrees())
    options.shape = globe.sphere() ? GlobeOptions::Shape::kSphere : GlobeOptions::Shape::kFlat;
  options.radius_km = globe.radius_km;
  options.vertical_scale = globe.vertical_scale;
}

bool describesAll(const Manifest& manifest, OpenGridOptions options, const std::vector<fs::path>& files) {
  try {
    const auto source = openStepOf(manifest, options, [&] { return openData(options); });
    const auto plain = [](const fs::path& path) { return fs::absolute(path).lexically_normal(); };
    std::set<fs::path> named;
    for (const std::string& file : source->description().files) named.insert(plain(file));
    return std::ranges::all_of(files, [&](const fs::path& file) { return named.contains(plain(file)); });
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    return false;
  }
}

/// Sets the files of a grid: the one that names all the others, or the folder that is a case, if `files` have one;
/// else all of them.
void setFiles(const Manifest& manifest, const std::vector<fs::path>& files, OpenGridOptions& grid) {
  std::vector<fs::path> candidates;
  if (files.size() > 1) {
    candidates.push_back(files.front());
    for (fs::path folder = fs::absolute(files.front()).parent_path(); folder.has_relative_path();
         folder = folder.parent_path())
      if (isGridFolder(folder)) candidates.push_back(folder);
  }
  for (const fs::path& one : candidates) {
    grid.grid = one;
    if (describesAll(manifest, grid, files)) return;
  }
  grid.grid = files.front();
  grid.solutions.assign(files.begin() + 1, files.end());
}

/// `found`: what the cache has there.
std::vector<std::optional<SourceValues>> sourceValues(const CacheReader& reader, const PointSource& from,
                                                      std::span<const glm::dvec3> points,
                                                      std::span<const std::optional<ProbeResult>> found) {
  const OpenSource source = openSource(reader, from);
  if (const auto* mesh = dynamic_cast<const MeshSource*>(source.grid.get()))
    return probeMesh(*mesh, source.scalars, source.ranges, points, ScratchFiles(systemTemporaryFolder()));
  std::vector<std::vector<NearSample>> near(points.size());
  for (size_t p = 0; p < points.size(); ++p)
    if (found[p])
      for (const ReachingSample& sample : found[p]->near)
        near[p].push_back({sample.block, {sample.i, sample.j, sample.k}});
  return probeGrid(dynamic_cast<const GridSource&>(*source.grid), source.scalars, source.ranges, points,
                   near);
}

/// See valuesAt(). The cache has the means of cells, and straight lines between: where a value leaps within a cell, it is far
/// from the source's.
std::string doubtOf(const Manifest& manifest, std::span<const glm::dvec3> points,
                    std::span<const std::optional<ProbeResult>> of_cache,
                    std::span<const std::optional<SourceValues>> of_source) {
  constexpr double kFar = 0.1;   // of the scalar's range
  constexpr size_t kOneIn = 10;  // points
  // Values beyond the cache's ranges are those of blanked samples.
  size_t of_cache_alone = 0, in_cache = 0;
  for (size_t p = 0; p < points.size(); ++p) {
    if (!of_cache[p] || of_cache[p]->is_beyond) continue;
    ++in_cache;
    of_cache_alone += !of_source[p];
  }
  if (of_cache_alone > 1 && 2 * of_cache_alone > in_cache)
    return fmt::format(
        "at {} of {} the files of --source have no values within the ranges of the cache; they may be of "
        "another time step",
        of_cache_alone, countText(in_cache, "point"));
  for (size_t v = 0; v < manifest.variables.size(); ++v) {
    const VariableInfo& variable = manifest.variables[v];
    size_t compared = 0, far = 0;
    std::string first;
    for (size_t p = 0; p < points.size(); ++p) {
      if (!of_cache[p] || of_cache[p]->is_beyond || !of_source[p]) continue;
      const double here = of_cache[p]->variables[v].value, there = of_source[p]->values[v];
      ++compared;
      const double rounding = 1e-6 * std::max(std::abs(variable.min), std::abs(variable.max));
      if (!(std::abs(here - there) > kFar * (variable.max - variable.min) + rounding)) continue;
      if (++far == 1)
        first = fmt::format("{} at {:g}, {:g}, {:g} is {:g} in the cache and {:g} in the files of --source",
                            variable.name, points[p].x, points[p].y, points[p].z, here, there);
    }
    if (far > 1 && kOneIn * far > compared) return first + "; they may be of another time step";
  }
  return "";
}

}  // namespace

std::unique_ptr<DataSource> openStepOf(const Manifest& manifest, OpenGridOptions& options,
                                       const std::function<std::unique_ptr<DataSource>()>& open) {
  std::unique_ptr<DataSource> source = open();
  const std::vector<double>& times = source->description().times;
  const double time = manifest.steps.front().time;
  if (options.time_step || times.size() < 2 || std::ranges::count(times, time) != 1) return source;
  const auto step = static_cast<uint32_t>(std::ranges::find(times, time) - times.begin());
  if (step == source->description().time_step) return source;
  options.time_step = step;
  return open();
}

std::vector<fs::path> sourcesOf(const Manifest& manifest, const fs::path& cache) {
  std::vector<fs::path> files;
  std::error_code ignored;
  for (const std::string& source : manifest.sources) {
    const fs::path given = source, beside = fs::absolute(cache).parent_path() / given.filename();
    const fs::path found = fs::exists(given, ignored) ? given : beside;
    if (!fs::exists(found, ignored)) return {};
    files.push_back(fs::absolute(found));
  }
  return files;
}

void setSource(const CacheReader& reader, const std::vector<fs::path>& files, OpenGridOptions& grid) {
  if (files.empty() && reader.series().steps.size() > 1)
    throw UsageError("{}: is a series; name the files of the time step after --source",
                     reader.cachePath().string());
  const std::vector<fs::path> found =
      files.empty() ? sourcesOf(reader.manifest(), reader.wholePath()) : files;
  if (found.empty())
    throw Error("{}: the files that it was made from are no longer there; name them after --source",
                reader.cachePath().string());
  setGlobe(reader.manifest(), grid.globe);
  if (files.empty()) return setFiles(reader.manifest(), found, grid);
  grid.grid = found.front();
  grid.solutions.assign(found.begin() + 1, found.end());
}

OpenSource openSource(const CacheReader& reader, const PointSource& source) {
  OpenGridOptions options = source.grid;
  OpenSource opened;
  for (const VariableInfo& variable : reader.manifest().variables) {
    options.scalars.push_back(variable.name);
    opened.ranges.push_back({variable.min, variable.max});
  }
  const DerivedOptions derived{source.gas, std::nullopt};
  const auto open = [&] {
    return openStepOf(reader.manifest(), options, [&] { return openWithDerived(options, derived); });
  };
  opened.grid = open();
  const GridDescription& description = opened.grid->description();
  opened.scalars = scalarsLike(reader, description, source.grid);
  const Refinement& refinement = reader.manifest().refinement;
  if (!dynamic_cast<const MeshSource*>(opened.grid.get()))
    requireSameBlocks(reader, description, source.grid);
  else if (refinement.cutsCells())
    requireSameSamples(reader, refinedBy(refinement, open(), std::nullopt)->description(), source.grid);
  else
    requireSameSamples(reader, description, source.grid);
  return opened;
}

std::vector<std::optional<PointValues>> valuesAt(const CacheReader& reader,
                                                 std::span<const glm::dvec3> points,
                                                 const PointSource* source, std::string* doubt) {
  std::vector<size_t> variables(reader.manifest().variables.size());
  std::iota(variables.begin(), variables.end(), size_t{0});
  const auto found = probeAll(reader, variables, points);
  std::vector<std::optional<PointValues>> all(points.size());
  if (source) {
    const auto of_source = sourceValues(reader, *source, points, found);
    if (doubt) *doubt = doubtOf(reader.manifest(), points, found, of_source);
    for (size_t p = 0; p < points.size(); ++p)
      if (const auto& at = of_source[p])
        all[p] = {at->block,
                  at->at[0],
                  at->at[1],
                  at->at[2],
                  at->place,
                  at->values,
                  {at->sample.begin(), at->sample.end()},
                  found[p] ? found[p]->distance : 0};
    return all;
  }
  for (size_t p = 0; p < points.size(); ++p) {
    if (!found[p] || found[p]->is_beyond) continue;
    const ProbeResult& at = *found[p];
    all[p] = {at.block, at.i, at.j, at.k, at.centre, {}, {}, at.distance};
    for (const ProbeVariable& variable : at.variables) {
      all[p]->values.push_back(variable.value);
      all[p]->sample.push_back(variable.mean);
    }
  }
  return all;
}

std::vector<std::optional<PointValues>> joinedValues(std::span<const SetValues> sets) {
  std::vector<std::optional<PointValues>> all(sets.front().found.size());
  std::vector<glm::dvec3> places(all.size(), glm::dvec3(0.0));
  for (size_t p = 0; p < all.size(); ++p) {
    const auto first =
        std::ranges::find_if(sets, [p](const SetValues& set) { return set.found[p].has_value(); });
    if (first == sets.end()) continue;
    all[p] = *first->found[p];
    all[p]->values.clear();
    all[p]->sample.clear();
    places[p] = all[p]->place;
  }
  for (const SetValues& set : sets) {
    const std::vector<double> none(set.reader->manifest().variables.size(),
                                   std::numeric_limits<double>::quiet_NaN());
    const auto there = set.has_ended ? set.found : valuesAt(*set.reader, places, set.source);
    const auto append = [](std::vector<double>& to, const std::vector<double>& values) {
      to.insert(to.end(), values.begin(), values.end());
    };
    for (size_t p = 0; p < all.size(); ++p) {
      if (!all[p]) continue;
      const std::optional<PointValues>& found = set.found[p];
      append(all[p]->values, found ? found->values : none);
      if (found && found->place == places[p])
        append(all[p]->sample, found->sample);
      else
        append(all[p]->sample, there[p] ? there[p]->values : none);
    }
  }
  return all;
}

}  // namespace curvisplat
