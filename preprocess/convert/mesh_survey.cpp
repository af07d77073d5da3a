#include "preprocess/convert/mesh_survey.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

#include "preprocess/convert/scan.h"
#include "stream/base/checksum.h"

namespace curvisplat {
namespace {

template <typename T>
void addBytes(Checksum& checksum, const std::vector<T>& values) {
  checksum.add(std::as_bytes(std::span(values)));
}

void widen(ScalarRange& range, float value) {
  range.min = std::min<double>(range.min, value);
  range.max = std::max<double>(range.max, value);
}

}  // namespace

MeshSurvey surveyMesh(const MeshReader& reader, Progress& progress) {
  MeshSurvey survey;
  GridSurvey& grid = survey.grid;
  const bool cell_data = reader.centring() == Centring::kCell;
  grid.ranges.resize(reader.scalars());
  grid.nodes = cell_data ? reader.cells() : reader.points();
  survey.used.resize(reader.points());

  std::vector<uint64_t> first_points{0};
  for (const MeshPiece& piece : reader.pieces()) first_points.push_back(first_points.back() + piece.points);
  reader.forEachCells([&](const LoadedCells& loaded) {
    const MeshCells& cells = loaded.cells;
    survey.chunk_bytes = std::max(survey.chunk_bytes, bytesOf(cells));
    for (size_t n = 0; n < cells.size(); ++n) {
      ++survey.cells_of[static_cast<size_t>(cells.shapes[n])];
      if (cells.shapes[n] == CellKind::kNone) continue;
      ++survey.drawn_cells;
      for (const uint64_t corner : cells.cornersOfCell(n))
        survey.used[first_points[loaded.range.piece] + corner] = true;
      for (size_t scalar = 0; scalar < cells.scalars.size(); ++scalar)
        widen(grid.ranges[scalar], cells.scalars[scalar][n]);
    }
    if (cell_data) grid.blanked += loaded.blanked;
    Checksum checksum;
    addBytes(checksum, cells.shapes);
    addBytes(checksum, cells.corners);
    addBytes(checksum, cells.faces);
    checksum.add(std::as_bytes(std::span(&loaded.range.number, 1)));
    grid.grid_checksum += checksum.value();
    progress.advance(cell_data ? loaded.range.count : 0);
  });

  reader.forEachPoints([&](const LoadedPoints& loaded) {
    const MeshPoints& points = loaded.points;
    for (size_t n = 0; n < points.x.size(); ++n) {
      if (!survey.used[loaded.range.number + n]) {
        ++survey.unused_points;
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
    Checksum checksum;
    addBytes(checksum, points.x);
    addBytes(checksum, points.y);
    addBytes(checksum, points.z);
    checksum.add(std::as_bytes(std::span(&loaded.range.number, 1)));
    grid.grid_checksum += checksum.value();
    progress.advance(cell_data ? 0 : loaded.range.count);
  });
  // Nothing is drawn where there is no cell, or where every point of them is blanked.
  if (survey.drawn_cells == 0 || !(grid.lower.x <= grid.upper.x))
    grid.blanked.by_grid = grid.nodes - grid.blanked.by_value - grid.blanked.not_finite;
  checkExtent(grid, reader.source().description());
  return survey;
}

}  // namespace curvisplat
