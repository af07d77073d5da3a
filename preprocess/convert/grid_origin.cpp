#include "preprocess/convert/grid_origin.h"

#include <algorithm>

#include "preprocess/convert/scan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/shared_passes.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/seams/thin_walls.h"
#include "preprocess/seams/wall_search.h"
#include "preprocess/splats/cell_splats.h"
#include "preprocess/survey/block_overlap.h"
#include "stream/base/error.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

GridOrigin::GridOrigin(const GridSource& source, const ConvertOptions& options, const MemoryPlan& plan,
                       std::filesystem::path scratch)
    : reader_(source, options.scalars, options.blank_value),
      overlap_(options.overlap),
      plan_(plan),
      ranks_(*options.ranks),
      scratch_(std::move(scratch)) {
  plan_.slab_bytes = slabBytesOfRanks(reader_, plan_.slab_bytes, ranks_);
}

void GridOrigin::requireMemory(const GridSource& source, const std::vector<uint32_t>& scalars,
                               const MemoryPlan& plan) {
  const std::vector<GridBlock>& blocks = source.description().blocks;
  const bool cells = NodeReader(source, scalars, std::nullopt).centring() == Centring::kCell;
  const uint64_t rows = source.rowsInMemory(scalars);
  if (rows == 0 ||
      leastSlabBytes(blocks, scalars.size(), cells ? kCellSplatHalo : kNodeSplatHalo) <= plan.slab_bytes)
    return;
  const auto longest = std::max_element(blocks.begin(), blocks.end(),
                                        [](const GridBlock& a, const GridBlock& b) { return a.ni < b.ni; });
  plan.requireRow(longest->name, longest->ni, rows * longest->ni * slabBytesPerNode(scalars.size()));
}

TemporaryNeeds GridOrigin::mostTemporaryNeeds() const {
  return {centring() == Centring::kCell ? needsOfFaces().disk_bytes : 0, 0, 0};
}

AbuttingFaces::Needs GridOrigin::needsOfFaces() const {
  const AbuttingFaces::Needs needs = AbuttingFaces::needsOf(blocks());
  if (2 * needs.memory_bytes > plan_.seam_bytes)
    throw Error("--memory: matching the faces of this grid's blocks takes {} MiB; give at least {} MiB",
                (needs.memory_bytes >> 20) + 1, (MemoryPlan::capForSeams(2 * needs.memory_bytes) >> 20) + 1);
  return needs;
}

/// The buffers for passes that do little with a node. The nodes of such a slab are still in the processor's
/// cache when they are worked on; as many threads read as there is memory for slabs.
SlabBuffers GridOrigin::smallSlabs(Halo halo) const {
  constexpr uint64_t kBytes = uint64_t{16} << 20, kMaxReaders = 4;
  const uint64_t bytes =
      std::min(plan_.slab_bytes, std::max(kBytes, leastSlabBytes(blocks(), reader_.scalars(), halo)));
  return {bytes, static_cast<unsigned>(
                     std::min<uint64_t>({2 * plan_.slab_bytes / bytes - 1, plan_.threads, kMaxReaders}))};
}

/// Fits in half of what counting may take, which it needs only after the slabs of the survey are gone. One thread counts it, so it is
/// no larger than it has to be: 4096 in a bucket tell its size within some percent, where 20 are planned for.
PositionSample GridOrigin::newSample() const {
  constexpr uint64_t kInBucket = 4096, kMaxPositions = uint64_t{1} << 21;
  uint64_t nodes = 0;
  for (const GridBlock& block : blocks()) nodes += block.nodes();
  const uint64_t wanted = (nodes / plan_.plannedBucketSplats() + 1) * kInBucket;
  const uint64_t affordable = plan_.counting_bytes / 2 / PositionSample::kBytesEach;
  return {nodes, std::clamp<uint64_t>(std::min(wanted, affordable), 1024, kMaxPositions)};
}

GridSurvey GridOrigin::survey(Progress& progress) {
  if (centring() == Centring::kCell)
    faces_ = std::make_unique<AbuttingFaces>(blocks(), description().coordinate_bytes,
                                             plan_.seam_bytes - needsOfFaces().memory_bytes, scratch_);
  sample_ = newSample();
  // Less would not tell how full a bucket gets within the margin that buckets are planned with.
  constexpr uint64_t kMinInBucket = 2000;
  if (sample_->nodesEach() > 1 && plan_.plannedBucketSplats() / sample_->nodesEach() < kMinInBucket)
    sample_.reset();
  GridSurvey survey = surveyGrid(reader_, smallSlabs(kNoHalo), {faces_.get(), sample_ ? &*sample_ : nullptr},
                                 progress, ranks_);
  if (faces_) faces_->match(progress);
  has_values_everywhere_ = survey.blanked.by_value == 0 && survey.blanked.not_finite == 0;
  if (ranks_.isFirst()) overlaps_ = findOverlaps(reader_.source(), plan_.forOverlaps(), progress);
  overlaps_ = fromBytes<BlockOverlap>(ranks_.broadcast(toBytes(overlaps_)));
  return survey;
}

std::vector<std::string> GridOrigin::warnings() {
  std::vector<std::string> warnings;
  if (const std::string line = unsearchedOverlaps(description()); !line.empty()) warnings.push_back(line);
  if (!hasOwners() && !overlaps_.empty()) warnings.push_back(overlapWarning(description(), overlaps_));
  return warnings;
}

std::string GridOrigin::warningOfWalls() const {
  if (!walls_.too_many) return "";
  return "values differ at more than half a million pairs of nodes that have one position; these are merged, "
         "and have "
         "the mean of both";
}

std::vector<std::string> GridOrigin::notes() {
  if (!hasOwners()) return {};
  return {overlapNote(description(), overlaps_)};
}

std::string GridOrigin::overlap() const {
  if (blocks().size() < 2) return "";
  return overlap_ == Overlap::kAll ? kOverlapAll : overlaps_.empty() ? kOverlapNone : kOverlapOwner;
}

void GridOrigin::count(const RootCube& root, CountingGrid& counts, Progress& progress) {
  if (sample_) {
    const bool is_of_share = centring() == Centring::kNode;
    if (is_of_share || ranks_.isFirst()) countSample(*sample_, root, counts);
    sample_.reset();
    return;
  }
  // Adding up keeps one thread busy for longer than reading does another.
  countNodes(reader_.source(), root, smallSlabs(kNoHalo).slab_bytes, counts, progress, shareOf(ranks_));
}

ScatterCounts GridOrigin::scatter(const SinkOfThread& sink_of_thread, const ScatterNotes& notes,
                                  Progress& progress) {
  seams_ = std::make_unique<SeamMerger>(reader_.scalars(), plan_.seam_bytes, scratch_);
  std::optional<BlockOwners> owners;
  if (hasOwners())
    owners.emplace(ownersReader(reader_, has_values_everywhere_), overlaps_, plan_.owner_bytes);
  SlabPass pass(progress);
  pass.ranks = &ranks_;
  pass.notes = notes;
  pass.owners = owners ? &*owners : nullptr;
  const ScatterCounts counts =
      streamSplats(reader_, faces_.get(), plan_.slab_bytes, sink_of_thread, *seams_, pass);
  faces_.reset();
  return counts;
}

uint64_t GridOrigin::finish(const SinkOfThread& sink_of_thread, Progress& progress) {
  seams_->sendToFirst(ranks_);
  if (!ranks_.isFirst()) {
    seams_.reset();
    return 0;
  }
  // The slabs' memory is free by now.
  walls_ = findThinWalls(*seams_, reader_, {plan_.slab_bytes, scratch_}, progress);
  seams_->keepApart(ThinWalls(walls_.boxes, blocks()));
  const uint64_t merged = seams_->finishInParallel(
      description().coordinate_bytes, [&](const NodeSplat& splat, std::span<const SplatScalar> values) {
        sink_of_thread().add(splat, values);
        progress.advance(1);
      });
  seams_.reset();
  return merged;
}

}  // namespace curvisplat
