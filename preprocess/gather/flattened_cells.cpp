#include "preprocess/gather/flattened_cells.h"

#include <tbb/blocked_range.h>

#include "preprocess/grid/parallel.h"
#include "preprocess/moments/cell_moments.h"

namespace curvisplat {
namespace {

constexpr size_t kCellsPerTask = 256;

}  // namespace

void FlattenedCells::assign(const GatheredCells& cells, CellSpace space, Volumes volumes) {
  cells_ = &cells;
  frames_.clear();
  if (space == CellSpace::kFlat) return;
  flat_ = cells;
  cells_ = &flat_;
  frames_.resize(cells.size());
  if (volumes == Volumes::kKept) flat_.volumes.resize(cells.size(), 0.0f);
  parallelFor(tbb::blocked_range<size_t>(0, cells.size(), kCellsPerTask),
              [&](const tbb::blocked_range<size_t>& part) {
                for (size_t n = part.begin(); n < part.end(); ++n) {
                  if (cells.shapes[n] == CellKind::kNone) continue;
                  const CellView view = cells.view(n, 0);
                  frames_[n] = SphereFrame::ofMiddle(view.corners);
                  for (size_t corner = cells.corner_begin[n]; corner < cells.corner_begin[n + 1]; ++corner)
                    flat_.at[corner] = frames_[n].flat(cells.at[corner]);
                  if (volumes == Volumes::kKept && cells.volumeOf(n) == 0)
                    flat_.volumes[n] = static_cast<float>(bodyOf(view).volume);
                }
              });
}

HalfFace FlattenedCells::inSpace(HalfFace face) const {
  if (!flattened()) return face;
  const SphereFrame& of_cell = frames_[face.cell];
  face.centre = of_cell.bent(face.centre);
  face.inward = of_cell.turnTo(SphereFrame(face.centre)) * face.inward;
  return face;
}

void flattenAt(const glm::dvec3& at, std::span<OuterPlane> planes) {
  const SphereFrame here(at);
  for (OuterPlane& plane : planes) {
    plane.inward = SphereFrame(plane.point).turnTo(here) * plane.inward;
    plane.point = here.flat(plane.point);
  }
}

}  // namespace curvisplat
