// The splats of an unstructured grid: of its points, from the moments of their dual cells, or of its cells
// where the scalars are cell-centred. DESIGN.md, "Unstructured grids". surveyMesh(), the first of its
// passes, also serves `info`.
//
//    survey    cells: which points are used; points: bounds, ranges, which are the same in several pieces
//    count     points
//    scatter   cells with their corners (corner_gather) --> point_sums or cell_slopes --> splats
//
// Memory grows with the mesh by a bit a point, and 16 bytes for each point that several pieces share. One
// thread calls.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/splat_origin.h"
#include "preprocess/gather/cell_slopes.h"
#include "preprocess/gather/gather_forecast.h"
#include "preprocess/gather/mesh_reader.h"
#include "preprocess/gather/point_numbers.h"
#include "preprocess/survey/grid_survey.h"
#include "stream/base/progress.h"
#include "stream/cache/manifest.h"

namespace curvisplat {

class MeshOrigin final : public SplatOrigin {
 public:
  /// `source` must outlive it. Temporary files go to `scratch`. Throws Error if node-centred and
  /// cell-centred scalars are mixed.
  MeshOrigin(const MeshSource& source, std::vector<uint32_t> scalars, std::optional<double> blank_value,
             const MemoryPlan& plan, ScratchFiles scratch);

  /// Makes splats as those of a cache were made: of cells between two faces one or two, by what its block says; of points and cells
  /// where nodes hang by Manifest::stretch.
  void follow(const Manifest& cache);

  const GridDescription& description() const override { return reader_.source().description(); }
  Centring centring() const override { return reader_.centring(); }
  /// One row of samples: the points, or the cells, of all pieces. There are two rows if it
  /// follows a cache whose cells are two splats.
  const std::vector<GridBlock>& blocks() const override { return blocks_; }
  TemporaryNeeds mostTemporaryNeeds() const override;
  TemporaryNeeds temporaryNeeds(const Progress& progress) const override;
  uint64_t temporaryBytes() const override;

  GridSurvey survey(Progress& progress) override;
  std::vector<std::string> warnings() override;
  void count(const RootCube& root, CountingGrid& counts, Progress& progress) override;
  ScatterCounts scatter(const SinkOfThread& sink_of_thread, const ScatterNotes& notes,
                        Progress& progress) override;
  uint64_t finish(const SinkOfThread& sink_of_thread, Progress& progress) override;

 private:
  using NeedsOf = std::function<GatherNeeds(const MeshReader&, const GatherJob&)>;
  TemporaryNeeds needsBy(const NeedsOf& needs_of) const;
  uint64_t samples() const { return centring() == Centring::kCell ? reader_.cells() : reader_.points(); }

  const MeshReader reader_;
  const MemoryPlan plan_;
  const ScratchFiles scratch_;
  const MeshSource::Preparation preparation_;
  std::vector<GridBlock> blocks_;
  SlabCells slabs_ = SlabCells::kHalved;
  HangingNodes hanging_ = HangingNodes::kFitted;
  std::optional<PointNumbers> numbers_;
  std::vector<bool> used_;  // [point]: a cell that is drawn has it
  uint64_t drawn_cells_ = 0, unused_points_ = 0, chunk_bytes_ = 0;
  std::string open_polyhedra_;  // warningOfOpenPolyhedra()
};

/// The contents of an unstructured grid.
struct MeshSurvey {
  GridSurvey grid;                              // samples: points or cells, as the reader's scalars are
  std::array<uint64_t, 6> cells_of{};           // [CellKind]; kNone: hidden ones and those that are not solid
  uint64_t drawn_cells = 0, unused_points = 0;  // unused: no solid cell has them, with a value or without
  uint64_t open_polyhedra = 0, first_open = 0;  // those that are not isClosed(), and the number of the first
  uint64_t chunk_bytes = 0;                     // of the largest chunk of cells that was read
  std::vector<bool> used;                       // [point]: a cell that is drawn has it
};

/// The first pass, for conversion and for `info`: reads cells, then points. Memory: a bit a point and a few
/// chunks. Throws Error if the files are damaged or if nothing is drawn. Does not depend on threads.
MeshSurvey surveyMesh(const MeshReader& reader, Progress& progress);

/// Empty if all polyhedra are closed.
std::string warningOfOpenPolyhedra(const MeshSurvey& survey);

}  // namespace curvisplat
