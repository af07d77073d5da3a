#include "preprocess/convert/scan.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <optional>

#include "preprocess/convert/shared_passes.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/cell_survey.h"
#include "preprocess/survey/grid_checksum.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr size_t kNodesPerTask = 16384;

// Splats are stored in single precision, their weights in units cubed.
constexpr double kSmallestExtent = 1e-9, kLargestExtent = 1e12;
// Splats hold variances, squares of differences of values; and they are added up.
constexpr double kLargestRange = 1e18;

void widen(GridSurvey& bounds, const NodeArrays& nodes, size_t begin, size_t end) {
  for (size_t n = begin; n < end; ++n) {
    if (nodes.blank[n]) continue;
    const glm::dvec3 position(nodes.x[n], nodes.y[n], nodes.z[n]);
    bounds.lower = glm::min(bounds.lower, position);
    bounds.upper = glm::max(bounds.upper, position);
  }
  for (size_t scalar = 0; scalar < bounds.ranges.size(); ++scalar) {
    ScalarRange& range = bounds.ranges[scalar];
    const std::vector<float>& values = nodes.scalars[scalar];
    for (size_t n = begin; n < end; ++n) {
      if (nodes.blank[n]) continue;
      range.min = std::min<double>(range.min, values[n]);
      range.max = std::max<double>(range.max, values[n]);
    }
  }
}

}  // namespace

void checkExtent(const GridSurvey& survey, const GridDescription& description, Centring centring) {
  const std::string file = description.files.empty() ? description.format : description.files.front();
  if (survey.nodes == survey.blanked.total())
    throw Error(
        "{}: every one of the {} {} is blanked ({} by the grid, {} by value, {} not finite in single "
        "precision): there is nothing to draw{}",
        file, survey.nodes, centring == Centring::kCell ? "cells" : "nodes", survey.blanked.by_grid,
        survey.blanked.by_value, survey.blanked.not_finite,
        survey.blanked.by_grid > 0 && !description.blanking.empty() ? "; " + description.blanking : "");
  const glm::dvec3 extent = survey.upper - survey.lower;
  const double largest = std::max({extent.x, extent.y, extent.z});
  if (largest > 0 && !(largest >= kSmallestExtent && largest <= kLargestExtent))
    throw Error("{}: the grid is {:g} units long; scale it to between {:g} and {:g}", file, largest,
                kSmallestExtent, kLargestExtent);
}

GridSurvey surveyGrid(const NodeReader& reader, uint64_t slab_bytes, AbuttingFaces* faces, Progress& progress,
                      Ranks* ranks) {
  if (reader.centring() == Centring::kCell) {
    const GridSurvey survey = surveyCells(reader, slab_bytes, faces, progress);
    checkExtent(survey, reader.source().description(), reader.centring());
    return survey;
  }
  GridSurvey none;
  none.ranges.resize(reader.scalars());
  GridSurvey survey = none;
  SlabStream slabs(reader, slab_bytes, kNoHalo, shareOf(ranks));
  while (const LoadedSlab* loaded = slabs.next()) {
    const size_t count = loaded->nodes.x.size();
    // The smallest and the largest do not depend on how the work is divided.
    GridSurvey of_slab = tbb::parallel_reduce(
        tbb::blocked_range<size_t>(0, count, kNodesPerTask), none,
        [&](const tbb::blocked_range<size_t>& range, GridSurvey bounds) {
          const TraceScope trace("scan nodes");
          widen(bounds, loaded->nodes, range.begin(), range.end());
          return bounds;
        },
        unitedSurvey);
    of_slab.nodes = count;
    of_slab.blanked = loaded->blanked;
    of_slab.grid_checksum = checksumOfGrid(*loaded, reader.source().description().blocks[loaded->slab.block]);
    survey = unitedSurvey(std::move(survey), of_slab);
    progress.advance(count);
  }
  if (ranks) survey = combinedSurvey(survey, *ranks);
  checkExtent(survey, reader.source().description(), reader.centring());
  return survey;
}

void checkRanges(const GridSurvey& survey, const GridDescription& description,
                 std::span<const uint32_t> scalars) {
  for (size_t n = 0; n < scalars.size(); ++n) {
    const auto [min, max] = survey.ranges.at(n);
    if (max - min <= kLargestRange) continue;
    throw Error(
        "{}: its values go from {:g} to {:g}, more than {:g} apart; if one of them says that there is no "
        "value, name it with --blank, else scale them",
        description.scalars.at(scalars[n]).name, min, max, kLargestRange);
  }
}

void countNodes(const GridSource& source, const RootCube& root, uint64_t slab_bytes, CountingGrid& counts,
                Progress& progress, const SlabShare& share) {
  const NodeReader coordinates(source, {}, std::nullopt);
  SlabStream slabs(coordinates, slab_bytes, kNoHalo, share);
  while (const LoadedSlab* loaded = slabs.next()) {
    const NodeArrays& nodes = loaded->nodes;
    const size_t tasks = (nodes.x.size() + kNodesPerTask - 1) / kNodesPerTask;
    const uint32_t level = counts.level();
    std::vector<VoxelRuns> runs(tasks, VoxelRuns(level));
    tbb::parallel_for(size_t{0}, tasks, [&](size_t task) {
      const TraceScope trace("count nodes");
      const size_t end = std::min(nodes.x.size(), (task + 1) * kNodesPerTask);
      for (size_t n = task * kNodesPerTask; n < end; ++n)
        if (!nodes.blank[n]) runs[task].add(root.fromWorld({nodes.x[n], nodes.y[n], nodes.z[n]}));
    });
    const TraceScope trace("add counts");
    for (const VoxelRuns& of_task : runs) counts.add(level, of_task.runs());
    progress.advance(nodes.x.size());
  }
}

uint32_t countingLevel(uint64_t nodes) {
  const auto per_axis = static_cast<uint64_t>(std::ceil(std::cbrt(static_cast<double>(nodes))));
  return std::min<uint32_t>(static_cast<uint32_t>(std::bit_width(per_axis)) + 3, kMaxLevel);
}

}  // namespace curvisplat
