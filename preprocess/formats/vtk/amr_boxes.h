// Patches of an AMR set (.vth, .vthb): boxes of cells of their levels' lattices, of which finer ones cover coarser ones.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "preprocess/formats/vtk/vtk_extent.h"

namespace curvisplat {

struct AmrPatch {
  size_t level = 0;
  VtkExtent cells;  // in the lattice of its level, both ends inclusive
};

/// [patch]: the cells that patches of the next level cover, indices from the patch's first cell. `ratios`: [level]: cells of
/// the next level along a cell. A cell that is covered in part is not hidden.
std::vector<std::vector<VtkExtent>> refinedCellsOf(const std::vector<AmrPatch>& patches,
                                                   const std::vector<std::array<int64_t, 3>>& ratios);

}  // namespace curvisplat
