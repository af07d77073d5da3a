#include "preprocess/convert/grid_origin.h"

#include "preprocess/convert/scan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/block_overlap.h"
#include "stream/base/error.h"

namespace curvisplat {

GridOrigin::GridOrigin(const GridSource& source, std::vector<uint32_t> scalars,
                       std::optional<double> blank_value, const MemoryPlan& plan,
                       std::filesystem::path scratch)
    : reader_(source, std::move(scalars), blank_value), plan_(plan), scratch_(std::move(scratch)) {}

void GridOrigin::requireMemory(const GridSource& source, const std::vector<uint32_t>& scalars,
                               MemoryPlan& plan) {
  const bool cells = NodeReader(source, scalars, std::nullopt).centring() == Centring::kCell;
  plan.requireSlabs(
      leastSlabBytes(source.description().blocks, scalars.size(), cells ? kCellHalo : kNodeHalo));
}

uint64_t GridOrigin::temporaryBytes() const {
  return centring() == Centring::kCell ? needsOfFaces().disk_bytes : 0;
}

AbuttingFaces::Needs GridOrigin::needsOfFaces() const {
  const AbuttingFaces::Needs needs = AbuttingFaces::needsOf(blocks());
  if (2 * needs.memory_bytes > plan_.seam_bytes)
    throw Error("--memory: the ends of so many blocks of cells take {} MiB; give at least {} MiB",
                (needs.memory_bytes >> 20) + 1, (MemoryPlan::capForSeams(2 * needs.memory_bytes) >> 20) + 1);
  return needs;
}

GridSurvey GridOrigin::survey(Progress& progress) {
  if (centring() == Centring::kCell)
    faces_ = std::make_unique<AbuttingFaces>(blocks(), description().coordinate_bytes,
                                             plan_.seam_bytes - needsOfFaces().memory_bytes, scratch_);
  GridSurvey survey = surveyGrid(reader_, plan_.slab_bytes, faces_.get(), progress);
  if (faces_) faces_->match(progress);
  return survey;
}

std::vector<std::string> GridOrigin::warnings(Progress& progress) {
  const std::vector<BlockOverlap> overlaps = findOverlaps(reader_.source(), plan_.slab_bytes, progress);
  if (overlaps.empty()) return {};
  return {overlapWarning(description(), overlaps)};
}

void GridOrigin::count(const RootCube& root, CountingGrid& counts, Progress& progress) {
  countNodes(reader_.source(), root, plan_.slab_bytes, counts, progress);
}

ScatterCounts GridOrigin::scatter(const SinkOfThread& sink_of_thread, Progress& progress) {
  seams_ = std::make_unique<SeamMerger>(reader_.scalars(), plan_.seam_bytes, scratch_);
  const ScatterCounts counts =
      streamSplats(reader_, faces_.get(), plan_.slab_bytes, sink_of_thread, *seams_, progress);
  faces_.reset();
  return counts;
}

uint64_t GridOrigin::finish(SplatSink& sink, Progress& progress) {
  const uint64_t merged = seams_->finish(description().coordinate_bytes,
                                         [&](const NodeSplat& splat, std::span<const SplatScalar> values) {
                                           sink.add(splat, values);
                                           progress.advance(1);
                                         });
  seams_.reset();
  return merged;
}

}  // namespace curvisplat
