#include "preprocess/addition/drawn_mesh.h"

#include "preprocess/gather/mesh_reader.h"

namespace curvisplat {

DrawnMesh::DrawnMesh(const MeshSource& source) : source_(&source) {
  uint64_t points = 0, cells = 0;
  for (const MeshPiece& piece : source.description().pieces) {
    first_points_.push_back(points);
    first_cells_.push_back(cells);
    points += piece.points;
    cells += piece.cells;
  }
}

void DrawnMesh::restrictTo(const CacheReader& cache, const MemoryPlan& plan,
                           const std::filesystem::path& temporary_folder, Progress& progress) {
  of_cells_ = cache.manifest().cells;
  const MeshReader reader(*source_, {}, std::nullopt);
  numbers_ = std::make_unique<PointNumbers>(reader, plan.mesh_bytes / 2, temporary_folder, progress);
  drawn_ = std::make_unique<DrawnNodes>(cache, plan, temporary_folder, progress);
}

void DrawnMesh::readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                           MeshPoints& out) const {
  source_->readPoints(piece, first, count, scalars, out);
  if (!drawn_ || of_cells_) return;
  std::vector<uint8_t> missing(count, 0);
  drawn_->blankOthers(first_points_[piece] + first, missing);
  for (size_t n = 0; n < count; ++n) {
    const uint64_t number = first_points_[piece] + first + n;
    if (missing[n] && (*numbers_)(number) != number) missing[n] = !drawn_->holds((*numbers_)(number));
    out.hidden[n] |= missing[n];
  }
}

void DrawnMesh::readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                          MeshCells& out) const {
  source_->readCells(piece, first, count, scalars, out);
  if (drawn_ && of_cells_) drawn_->blankOthers(first_cells_[piece] + first, out.hidden);
}

}  // namespace curvisplat
