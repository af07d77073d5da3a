#include "preprocess/formats/vtk/amr_boxes.h"

#include <algorithm>

namespace curvisplat {
namespace {

int64_t floorOf(int64_t a, int64_t b) {
  return a / b - (a % b != 0 && a < 0);
}

/// The cells of the coarser level that lie in `fine`; empty (lower > upper) along an axis if there are none.
VtkExtent coarsened(const VtkExtent& fine, const std::array<int64_t, 3>& ratio) {
  VtkExtent coarse;
  for (size_t axis = 0; axis < 3; ++axis) {
    coarse.lower[axis] = -floorOf(-fine.lower[axis], ratio[axis]);
    coarse.upper[axis] = floorOf(fine.upper[axis] + 1, ratio[axis]) - 1;
  }
  return coarse;
}

}  // namespace

std::vector<std::vector<VtkExtent>> refinedCellsOf(const std::vector<AmrPatch>& patches,
                                                   const std::vector<std::array<int64_t, 3>>& ratios) {
  std::vector<std::vector<VtkExtent>> refined(patches.size());
  for (const AmrPatch& fine : patches) {
    if (fine.level == 0) continue;
    const VtkExtent covered = coarsened(fine.cells, ratios.at(fine.level - 1));
    for (size_t n = 0; n < patches.size(); ++n) {
      if (patches[n].level + 1 != fine.level) continue;
      const VtkExtent& cells = patches[n].cells;
      VtkExtent common;
      bool any = true;
      for (size_t axis = 0; axis < 3; ++axis) {
        common.lower[axis] = std::max(covered.lower[axis], cells.lower[axis]) - cells.lower[axis];
        common.upper[axis] = std::min(covered.upper[axis], cells.upper[axis]) - cells.lower[axis];
        any &= common.lower[axis] <= common.upper[axis];
      }
      if (any) refined[n].push_back(common);
    }
  }
  return refined;
}

}  // namespace curvisplat
