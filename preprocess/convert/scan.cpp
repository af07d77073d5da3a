#include "preprocess/convert/scan.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <optional>

#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/shared_passes.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr size_t kCountedPerTask = 16384;
constexpr size_t kPositionsAtOnce = size_t{1} << 18;  // 4 MiB of runs at most

// Splats are stored in single precision, their weights in units cubed.
constexpr double kSmallestExtent = 1e-9, kLargestExtent = 1e12;
// Splats hold variances, squares of differences of values; and they are added up.
constexpr double kLargestRange = 1e18;

void widenBounds(GridSurvey& bounds, const NodeArrays& nodes, size_t begin, size_t end) {
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

/// Counts positions a part at a time: while the threads gather one part's voxels, one of them adds those of the part before
/// to the counts, in the order of the positions.
class PartCounter {
 public:
  explicit PartCounter(CountingGrid& counts) : counts_(counts) {}

  /// `gather(runs, begin, end)` adds the positions begin .. end - 1 of `positions` to runs, in any thread.
  template <typename Gather>
  void add(size_t positions, const Gather& gather) {
    for (size_t begin = 0; begin < positions; begin += kPositionsAtOnce) {
      const size_t end = std::min(positions, begin + kPositionsAtOnce);
      std::vector<VoxelRuns> gathered((end - begin + kCountedPerTask - 1) / kCountedPerTask,
                                      VoxelRuns(counts_.level()));
      parallelInvoke([&] { addGathered(); },
                     [&] {
                       parallelFor(size_t{0}, gathered.size(), [&](size_t task) {
                         const TraceScope trace("count nodes");
                         const size_t first = begin + task * kCountedPerTask;
                         gather(gathered[task], first, std::min(end, first + kCountedPerTask));
                       });
                     });
      gathered_ = std::move(gathered);
    }
  }
  /// To be called at the end.
  void finish() { addGathered(); }

 private:
  void addGathered() {
    const TraceScope trace("add counts");
    for (const VoxelRuns& runs : gathered_) counts_.add(runs.level(), runs.runs());
    gathered_.clear();
  }

  CountingGrid& counts_;
  std::vector<VoxelRuns> gathered_;  // not yet added
};

}  // namespace

void checkExtent(const GridSurvey& survey, const GridDescription& description) {
  const std::string file = description.files.empty() ? description.format : description.files.front();
  const bool all_blanked = survey.nodes == survey.blanked.total();
  if (all_blanked && !survey.blanked.lost.empty()) throw DifferingBlanks(survey.blanked.lost, false);
  const auto isFlat = [](const GridBlock& block) { return std::min({block.ni, block.nj, block.nk}) < 2; };
  if (all_blanked && survey.blanked.not_finite == survey.nodes && !description.blocks.empty() &&
      std::ranges::all_of(description.blocks, isFlat))
    throw NothingToDraw(
        "{}: the grid is flat: its {} nodes lie in blocks of a single plane, which have no volume; no value "
        "of "
        "the chosen scalars is finite there, and there is nothing to draw",
        file, survey.nodes);
  if (all_blanked)
    throw NothingToDraw(
        "{}: all {} samples are blanked ({} by the grid, {} by value, {} not finite in single "
        "precision): there is nothing to draw{}",
        file, survey.nodes, survey.blanked.by_grid, survey.blanked.by_value, survey.blanked.not_finite,
        survey.blanked.by_grid > 0 && !description.blanking.empty() ? "; " + description.blanking : "");
  const glm::dvec3 extent = survey.upper - survey.lower;
  const double largest = std::max({extent.x, extent.y, extent.z});
  if (largest > 0 && !(largest >= kSmallestExtent && largest <= kLargestExtent))
    throw Error("{}: the grid is {:g} units long; scale it to between {:g} and {:g}", file, largest,
                kSmallestExtent, kLargestExtent);
}

GridSurvey surveyGrid(const NodeReader& reader, const SlabBuffers& slabs, const SurveyExtras& extras,
                      Progress& progress, Ranks& ranks) {
  if (reader.centring() == Centring::kCell) {
    const GridSurvey survey = surveyCells(reader, slabs.slab_bytes, extras, progress);
    checkExtent(survey, reader.source().description());
    return survey;
  }
  GridSurvey none;
  none.ranges.resize(reader.scalars());
  GridSurvey survey = none;
  SlabShare share = shareOf(ranks);
  share.whole_rows = true;  // for the checksum
  SlabStream stream(reader, slabs, kNoHalo, share);
  GridChecksum checksum;
  while (const LoadedSlab* loaded = stream.next()) {
    const size_t count = loaded->nodes.x.size();
    // The smallest and the largest do not depend on how the work is divided.
    GridSurvey of_slab = parallelReduce(
        tbb::blocked_range<size_t>(0, count, kCountedPerTask), none,
        [&](const tbb::blocked_range<size_t>& range, GridSurvey bounds) {
          const TraceScope trace("scan nodes");
          widenBounds(bounds, loaded->nodes, range.begin(), range.end());
          return bounds;
        },
        unitedSurvey);
    of_slab.nodes = count;
    of_slab.blanked = loaded->blanked;
    const GridBlock& block = reader.source().description().blocks[loaded->slab.block];
    checksum.add(*loaded, block);
    if (extras.sample) extras.sample->add(*loaded, block);
    survey = unitedSurvey(std::move(survey), of_slab);
    progress.advance(count);
  }
  survey.grid_checksum = checksum.value();
  survey = combinedSurvey(survey, ranks);
  checkExtent(survey, reader.source().description());
  return survey;
}

std::vector<std::string> warningsOfValues(const GridSurvey& survey, const DataSource& source,
                                          std::span<const uint32_t> scalars) {
  std::vector<std::string> warnings = warningsOfRanges(source, scalars, survey.ranges);
  const auto& lost = survey.blanked.lost;
  for (size_t n = 0; n < std::min(lost.size(), scalars.size()); ++n)
    if (lost[n].samples > 0)
      warnings.push_back(fmt::format(
          "{} of the values of {} are left out, since other scalars of the cache have none there; "
          "convert it to a cache of its own",
          lost[n].samples, source.description().scalars[scalars[n]].name));
  return warnings;
}

void checkRanges(const GridSurvey& survey, const GridDescription& description,
                 std::span<const uint32_t> scalars) {
  std::string first;
  std::vector<uint32_t> wide;
  for (size_t n = 0; n < scalars.size(); ++n) {
    const auto [min, max] = survey.ranges.at(n);
    if (max - min <= kLargestRange) continue;
    wide.push_back(scalars[n]);
    if (first.empty())
      first = fmt::format("{}: its values go from {:g} to {:g}, more than {:g} apart",
                          description.scalars.at(scalars[n]).name, min, max, kLargestRange);
  }
  if (wide.empty()) return;
  throw WideScalars(
      first + "; if one of them marks missing values, convert with --blank VALUE; otherwise scale the values",
      std::move(wide));
}

void countNodes(const GridSource& source, const RootCube& root, const SlabBuffers& slabs,
                CountingGrid& counts, Progress& progress, const SlabShare& share) {
  const NodeReader coordinates(source, {}, std::nullopt);
  SlabStream stream(coordinates, slabs, kNoHalo, share);
  PartCounter counter(counts);
  while (const LoadedSlab* loaded = stream.next()) {
    const NodeArrays& nodes = loaded->nodes;
    counter.add(nodes.x.size(), [&](VoxelRuns& runs, size_t begin, size_t end) {
      for (size_t n = begin; n < end; ++n)
        if (!nodes.blank[n]) runs.add(root.fromWorld({nodes.x[n], nodes.y[n], nodes.z[n]}));
    });
    progress.advance(nodes.x.size());
  }
  counter.finish();
}

void countSample(const PositionSample& sample, const RootCube& root, CountingGrid& counts) {
  const std::span<const glm::dvec3> positions = sample.positions();
  PartCounter counter(counts);
  counter.add(positions.size(), [&](VoxelRuns& runs, size_t begin, size_t end) {
    for (const glm::dvec3& position : positions.subspan(begin, end - begin))
      runs.add(root.fromWorld(position));
    runs.multiply(sample.nodesEach());
  });
  counter.finish();
}

uint32_t countingLevel(uint64_t nodes, const glm::dvec3& extent) {
  constexpr double kThinnest = 1e-3;  // of a box, where the grid is a plane or a line
  const double longest = std::max({extent.x, extent.y, extent.z});
  double share = 1;  // of the cube
  for (int axis = 0; axis < 3 && longest > 0; ++axis) share *= std::max(extent[axis] / longest, kThinnest);
  const auto per_axis = static_cast<uint64_t>(std::ceil(std::cbrt(static_cast<double>(nodes) / share)));
  return std::min<uint32_t>(static_cast<uint32_t>(std::bit_width(per_axis)) + 1, kMaxLevel);
}

}  // namespace curvisplat
