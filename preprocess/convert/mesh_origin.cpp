#include "preprocess/convert/mesh_origin.h"

#include <fmt/format.h>
#include <glm/common.hpp>

#include <algorithm>
#include <cmath>

#include "preprocess/convert/convert_options.h"
#include "preprocess/convert/scan.h"
#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/point_sums.h"
#include "preprocess/grid/parallel.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr size_t kPointsPerTask = 16384;

}  // namespace

MeshOrigin::MeshOrigin(const MeshSource& source, std::vector<uint32_t> scalars,
                       std::optional<double> blank_value, const MemoryPlan& plan, ScratchFiles scratch)
    : reader_(source, std::move(scalars), blank_value),
      plan_(plan),
      scratch_(std::move(scratch)),
      preparation_(source.preparationFor(reader_.scalarIndices())) {
  blocks_.push_back({centring() == Centring::kCell ? "cells" : "points", samples(), 1, 1, false});
}

void MeshOrigin::follow(const Manifest& cache) {
  const bool halved =
      cache.isMesh() && cache.cells && centring() == Centring::kCell && cache.blocks[0].nk == 2;
  slabs_ = halved ? SlabCells::kHalved : SlabCells::kWhole;
  blocks_.front().nk = halved ? 2 : 1;
  hanging_ = cache.stretch == kHangingNodes ? HangingNodes::kFitted : HangingNodes::kAsOthers;
}

TemporaryNeeds MeshOrigin::needsBy(const NeedsOf& needs_of) const {
  const MeshReader positions(reader_.source(), {}, std::nullopt);
  const GatherNeeds gather = needs_of(positions, {centring(), reader_.scalars(), plan_.mesh_bytes});
  TemporaryNeeds needs{gather.before_splats, gather.beside_splats, 0, gather.splats};
  if (preparation_.values == 0) return needs;
  const GatherNeeds of_values =
      needs_of(positions, {preparation_.centring, preparation_.fields, plan_.mesh_bytes});
  needs.lasting = preparation_.values * samples() * sizeof(float);
  needs.before_splats = std::max({needs.before_splats, of_values.before_splats, of_values.beside_splats});
  return needs;
}

TemporaryNeeds MeshOrigin::mostTemporaryNeeds() const {
  return needsBy([](const MeshReader& reader, const GatherJob& job) { return boundOfGather(reader, job); });
}

TemporaryNeeds MeshOrigin::temporaryNeeds(const Progress& progress) const {
  constexpr uint64_t kMarginPercent = 5;  // what was measured was up to 4 % more
  return needsBy([&](const MeshReader& reader, const GatherJob& job) {
    GatherNeeds needs = forecastOfGather(reader, job, progress);
    needs.before_splats += needs.before_splats * kMarginPercent / 100;
    needs.beside_splats += needs.beside_splats * kMarginPercent / 100;
    return needs;
  });
}

uint64_t MeshOrigin::temporaryBytes() const {
  const uint64_t values_bytes = preparation_.values * samples() * sizeof(float);
  return std::max(reader_.source().preparedBytes(), values_bytes + scratch_.mostBytes());
}

GridSurvey MeshOrigin::survey(Progress& progress) {
  if (reader_.points() / 8 > plan_.mesh_bytes / 4)
    throw Error("--memory: a mesh of {} points needs at least {} MiB", reader_.points(),
                MemoryPlan::capForMesh(reader_.points() / 2) >> 20);
  reader_.prepare(plan_.mesh_bytes, progress);
  MeshSurvey survey = surveyMesh(reader_, progress);
  used_ = std::move(survey.used);
  drawn_cells_ = survey.drawn_cells;
  unused_points_ = survey.unused_points;
  chunk_bytes_ = survey.chunk_bytes;
  open_polyhedra_ = warningOfOpenPolyhedra(survey);
  numbers_.emplace(reader_, plan_.mesh_bytes / 2, scratch_, progress);
  return survey.grid;
}

std::vector<std::string> MeshOrigin::warnings() {
  std::vector<std::string> warnings;
  if (unused_points_ > 0)
    warnings.push_back(fmt::format("{} of {} points belong to no solid cell and are left out", unused_points_,
                                   reader_.points()));
  if (!open_polyhedra_.empty()) warnings.push_back(open_polyhedra_);
  return warnings;
}

void MeshOrigin::count(const RootCube& root, CountingGrid& counts, Progress& progress) {
  // Cells lie where points do, about. A point that several pieces or elements have counts once.
  const bool cells = centring() == Centring::kCell;
  const uint64_t points_counted = reader_.points() - numbers_->merged();
  const uint64_t each = cells ? 2 * drawn_cells_ / std::max<uint64_t>(1, points_counted) + 1 : 1;
  const MeshReader positions(reader_.source(), {}, std::nullopt);
  std::vector<uint64_t> numbers;
  positions.forEachPoints([&](const LoadedPoints& loaded) {
    const MeshPoints& points = loaded.points;
    numbers.resize(points.x.size());
    numbers_->read(loaded.range.number, numbers);
    const size_t tasks = (points.x.size() + kPointsPerTask - 1) / kPointsPerTask;
    const uint32_t level = counts.level();
    std::vector<VoxelRuns> runs(tasks, VoxelRuns(level));
    parallelFor(size_t{0}, tasks, [&](size_t task) {
      const TraceScope trace("splats of cells");
      const size_t end = std::min(points.x.size(), (task + 1) * kPointsPerTask);
      for (size_t n = task * kPointsPerTask; n < end; ++n)
        if (const uint64_t number = loaded.range.number + n;
            used_[number] && numbers[n] == number && std::isfinite(points.x[n]))
          runs[task].add(root.fromWorld({points.x[n], points.y[n], points.z[n]}));
    });
    for (const VoxelRuns& of_task : runs) {
      std::vector<VoxelRun> scaled(of_task.runs().begin(), of_task.runs().end());
      for (VoxelRun& run : scaled)
        run.count = static_cast<uint32_t>(std::min<uint64_t>(run.count * each, INT32_MAX));
      counts.add(level, scaled);
    }
    progress.advance(cells ? 0 : points.x.size());
  });
}

ScatterCounts MeshOrigin::scatter(const SinkOfThread& sink_of_thread, const ScatterNotes&,
                                  Progress& progress) {
  freeMemory(used_);
  const uint64_t half = halfBesideChunks(plan_.mesh_bytes, chunk_bytes_);
  CornerGather gather(reader_, *numbers_, half, scratch_, progress);
  const TakeSplat take = [&](const NodeSplat& splat, std::span<const SplatScalar> values) {
    sink_of_thread().add(splat, values);
  };
  PointSums::Counts counts;
  if (centring() == Centring::kCell) {
    CellSlopes slopes(reader_.cells(), reader_.scalars(), half, scratch_);
    gather.forEach([&](const GatheredCells& cells) { slopes.add(cells); });
    counts = slopes.finish(take, slabs_, hanging_, progress);
  } else {
    PointSums sums(reader_.points(), drawn_cells_, reader_.scalars(), half, scratch_);
    gather.forEach([&](const GatheredCells& cells) { sums.add(cells); });
    counts = sums.finish(take, hanging_, progress);
  }
  if (counts.splats == 0)
    throw NothingToDraw("{}: every cell has a blanked point: there is nothing to draw",
                        description().files.empty() ? description().format : description().files.front());
  return {counts.degenerate, 0, counts.halved, counts.hanging};
}

uint64_t MeshOrigin::finish(const SinkOfThread&, Progress&) {
  return numbers_->merged();
}

namespace {

/// The checksum of arrays of a range, and of the range's number.
template <typename... T>
uint64_t checksumOfRange(uint64_t number, const std::vector<T>&... arrays) {
  Checksum checksum;
  (checksum.add(std::as_bytes(std::span(arrays))), ...);
  checksum.add(std::as_bytes(std::span(&number, 1)));
  return checksum.value();
}

void widen(ScalarRange& range, float value) {
  range.min = std::min<double>(range.min, value);
  range.max = std::max<double>(range.max, value);
}

}  // namespace

std::string warningOfOpenPolyhedra(const MeshSurvey& survey) {
  if (survey.open_polyhedra == 0) return "";
  return fmt::format(
      "{} of {} polyhedra do not close, the first is cell {}: an edge belongs to one of their faces alone; "
      "their "
      "volumes may be wrong",
      survey.open_polyhedra, survey.cells_of[static_cast<size_t>(CellKind::kPolyhedron)], survey.first_open);
}

MeshSurvey surveyMesh(const MeshReader& reader, Progress& progress) {
  MeshSurvey survey;
  GridSurvey& grid = survey.grid;
  const bool cell_data = reader.centring() == Centring::kCell;
  grid.ranges.resize(reader.scalars());
  grid.nodes = cell_data ? reader.cells() : reader.points();
  survey.used.resize(reader.points());
  std::vector<bool> of_blanked;  // [point]: a solid cell without a value has it; empty if there is none

  std::vector<uint64_t> first_points{0};
  for (const MeshPiece& piece : reader.pieces()) first_points.push_back(first_points.back() + piece.points);
  reader.forEachCells([&](const LoadedCells& loaded) {
    const MeshCells& cells = loaded.cells;
    survey.chunk_bytes = std::max(survey.chunk_bytes, bytesOf(cells));
    for (size_t n = 0; n < cells.size(); ++n) {
      ++survey.cells_of[static_cast<size_t>(cells.shapes[n])];
      if (cells.shapes[n] == CellKind::kNone && cells.hidden[n] == kHasNoValue) {
        of_blanked.resize(reader.points());
        for (const uint64_t corner : cells.cornersOfCell(n))
          of_blanked[first_points[loaded.range.piece] + corner] = true;
      }
      if (cells.shapes[n] == CellKind::kNone) continue;
      ++survey.drawn_cells;
      if (cells.shapes[n] == CellKind::kPolyhedron && !isClosed(cells.facesOfCell(n)) &&
          survey.open_polyhedra++ == 0)
        survey.first_open = loaded.range.number + n;
      for (const uint64_t corner : cells.cornersOfCell(n))
        survey.used[first_points[loaded.range.piece] + corner] = true;
      for (size_t scalar = 0; scalar < cells.scalars.size(); ++scalar)
        widen(grid.ranges[scalar], cells.scalars[scalar][n]);
    }
    if (cell_data) grid.blanked += loaded.blanked;
    grid.grid_checksum += checksumOfRange(loaded.range.number, cells.shapes, cells.corners, cells.faces);
    progress.advance(cell_data ? loaded.range.count : 0);
  });

  reader.forEachPoints([&](const LoadedPoints& loaded) {
    const MeshPoints& points = loaded.points;
    for (size_t n = 0; n < points.x.size(); ++n) {
      if (!survey.used[loaded.range.number + n]) {
        if (of_blanked.empty() || !of_blanked[loaded.range.number + n]) ++survey.unused_points;
        continue;
      }
      if (std::isnan(points.x[n])) continue;
      const glm::dvec3 at(points.x[n], points.y[n], points.z[n]);
      grid.lower = glm::min(grid.lower, at);
      grid.upper = glm::max(grid.upper, at);
      for (size_t scalar = 0; scalar < points.scalars.size(); ++scalar)
        widen(grid.ranges[scalar], points.scalars[scalar][n]);
    }
    if (!cell_data) grid.blanked += loaded.blanked;
    grid.grid_checksum += checksumOfRange(loaded.range.number, points.x, points.y, points.z);
    progress.advance(cell_data ? 0 : loaded.range.count);
  });
  // Nothing is drawn where there is no cell, or where every point of them is blanked.
  if (survey.drawn_cells == 0 || !(grid.lower.x <= grid.upper.x))
    grid.blanked.by_grid = grid.nodes - grid.blanked.by_value - grid.blanked.not_finite;
  checkExtent(grid, reader.source().description());
  return survey;
}

}  // namespace curvisplat
