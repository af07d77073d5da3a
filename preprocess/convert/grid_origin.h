// The splats of a structured grid: of its nodes, or of its cells where the scalars are cell-centred. Those of
// block faces go through the seam merger, and cells look for the blocks that they abut on.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/overset/block_owners.h"
#include "preprocess/seams/seams.h"
#include "preprocess/seams/wall_search.h"
#include "preprocess/survey/grid_survey.h"

namespace curvisplat {

class GridOrigin final : public SplatOrigin {
 public:
  /// `source` and the options' ranks must outlive it. Temporary files go to `scratch`. Throws Error if node-centred and
  /// cell-centred scalars are mixed.
  GridOrigin(const GridSource& source, const ConvertOptions& options, const MemoryPlan& plan,
             std::filesystem::path scratch);

  /// Throws Error that names a sufficient cap, where the source reads rows as a whole and they are too long.
  static void requireMemory(const GridSource& source, const std::vector<uint32_t>& scalars,
                            const MemoryPlan& plan);

  const GridDescription& description() const override { return reader_.source().description(); }
  Centring centring() const override { return reader_.centring(); }
  const std::vector<GridBlock>& blocks() const override { return description().blocks; }
  TemporaryNeeds mostTemporaryNeeds() const override;

  bool isShared() const override { return true; }
  GridSurvey survey(Progress& progress) override;
  std::vector<std::string> warnings() override;
  std::vector<std::string> notes() override;
  std::string overlap() const override;
  bool cutsOctants() const override { return centring() == Centring::kNode; }
  uint32_t splatsPerCounted() const override { return sample_ ? sample_->nodesEach() : 1; }
  void count(const RootCube& root, CountingGrid& counts, Progress& progress) override;
  ScatterCounts scatter(const SinkOfThread& sink_of_thread, const ScatterNotes& notes,
                        Progress& progress) override;
  uint64_t finish(const SinkOfThread& sink_of_thread, Progress& progress) override;
  std::vector<WallSide> thinWalls() const override { return walls_.boxes; }
  std::string warningOfWalls() const override;
  FacesFiles writeFaces(const FacesJob& job, Progress& progress) override {
    return writeGridFaces(reader_, job, smallSlabs(job.halo()), progress);
  }

 private:
  AbuttingFaces::Needs needsOfFaces() const;
  SlabBuffers smallSlabs(Halo halo) const;
  PositionSample newSample() const;

  bool hasOwners() const { return overlap_ == Overlap::kOwner && !overlaps_.empty(); }

  const NodeReader reader_;
  const Overlap overlap_;
  MemoryPlan plan_;
  Ranks& ranks_;
  const std::filesystem::path scratch_;
  std::vector<BlockOverlap> overlaps_;
  bool has_values_everywhere_ = false;    // where the grid has nodes
  std::unique_ptr<AbuttingFaces> faces_;  // of cells
  std::optional<PositionSample> sample_;  // from survey() to count(), if it is large enough to plan by
  std::unique_ptr<SeamMerger> seams_;     // of nodes
  FoundWalls walls_;
};

}  // namespace curvisplat
