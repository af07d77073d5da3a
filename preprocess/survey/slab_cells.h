// Visits the cells of a slab, for passes that locate things in them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/grid/slabs.h"

namespace curvisplat {

/// Calls each(element of the lowest node, strides, i, j, k) for the cells of a slab with kCornerHalo that are not blanked, in
/// parallel by rows where that pays; skips rows for which keep(j, k) is false.
template <typename Keep, typename Each>
void forEachCell(const GridBlock& block, const LoadedSlab& loaded, const Keep& keep, const Each& each) {
  constexpr size_t kFewNodes = 2048;  // to work on them takes less than to wake a thread
  const Slab& slab = loaded.slab;
  const WindowStrides strides(slab.window, block.ni);
  const uint64_t width = slab.box.j1 - slab.box.j0;
  const auto visit_row = [&](uint64_t n) {
    const uint64_t j = slab.box.j0 + n % width, k = slab.box.k0 + n / width;
    if (j + 1 >= block.nj || k + 1 >= block.nk || !keep(j, k)) return;
    size_t at = strides.at(slab.box.i0, j, k);
    for (uint64_t i = slab.box.i0; i < slab.box.i1 && i + 1 < block.ni; ++i, ++at)
      if (!cornerMarks(loaded.nodes.blank.data(), at, strides.row, strides.plane))
        each(at, strides.row, strides.plane, i, j, k);
  };
  if (loaded.nodes.x.size() > kFewNodes)
    parallelFor(uint64_t{0}, rowsOf(slab.box), visit_row);
  else
    for (uint64_t n = 0; n < rowsOf(slab.box); ++n) visit_row(n);
}

/// The corners of a cell, as Hexahedron takes them.
inline std::array<glm::dvec3, 8> cornersIn(const LoadedSlab& loaded, size_t at, size_t row, size_t plane) {
  return cornersAt(loaded.nodes.x.data(), loaded.nodes.y.data(), loaded.nodes.z.data(), at, row, plane);
}

}  // namespace curvisplat
