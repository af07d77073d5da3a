#include "preprocess/survey/grid_checksum.h"

#include <tbb/blocked_range.h>

#include <array>
#include <functional>
#include <span>

#include "preprocess/grid/parallel.h"
#include "stream/base/checksum.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr uint64_t kNodesPerTask = 16384;

/// Of x, y, z and blank of a row.
uint64_t checksumOfRow(uint32_t block, uint64_t j, uint64_t k, const std::array<uint64_t, 4>& arrays) {
  const std::array<uint64_t, 7> parts{block, j, k, arrays[0], arrays[1], arrays[2], arrays[3]};
  return checksumOf(std::as_bytes(std::span(parts)));
}

}  // namespace

void GridChecksum::add(const LoadedSlab& loaded, const GridBlock& block) {
  const Slab& slab = loaded.slab;
  const NodeArrays& nodes = loaded.nodes;
  const WindowStrides strides(slab.window, block.ni);
  const uint64_t width = slab.box.j1 - slab.box.j0, row_nodes = slab.box.rowNodes(block.ni);
  const bool whole = slab.box.hasWholeRows(block.ni);
  if (!whole && slab.box.i0 == 0) rows_ = std::vector<Row>(rowsOf(slab.box));
  const auto of_row = [&](uint64_t row) {
    const uint64_t j = slab.box.j0 + row % width, k = slab.box.k0 + row / width;
    if (!whole) return ofParts(rows_[row], loaded, block, j, k);
    const size_t first = strides.at(0, j, k);
    const auto of = [&](const auto& values) {
      return checksumOf(std::as_bytes(std::span(values).subspan(first, block.ni)));
    };
    return checksumOfRow(slab.block, j, k, {of(nodes.x), of(nodes.y), of(nodes.z), of(nodes.blank)});
  };
  sum_ += parallelReduce(
      tbb::blocked_range<uint64_t>(0, rowsOf(slab.box), kNodesPerTask / row_nodes + 1), uint64_t{0},
      [&](const tbb::blocked_range<uint64_t>& range, uint64_t sum) {
        const TraceScope trace("checksum");
        for (uint64_t row = range.begin(); row < range.end(); ++row) sum += of_row(row);
        return sum;
      },
      std::plus<>());
}

/// The row's checksum if the slab has its last part, else 0.
uint64_t GridChecksum::ofParts(Row& row, const LoadedSlab& loaded, const GridBlock& block, uint64_t j,
                               uint64_t k) const {
  const Slab& slab = loaded.slab;
  const NodeArrays& nodes = loaded.nodes;
  const size_t first = WindowStrides(slab.window, block.ni).at(slab.box.i0, j, k);
  const size_t count = slab.box.rowNodes(block.ni);
  const auto add = [&](const auto& values, Checksum& to) {
    to.add(std::as_bytes(std::span(values).subspan(first, count)));
  };
  add(nodes.x, row.x);
  add(nodes.y, row.y);
  add(nodes.z, row.z);
  add(nodes.blank, row.blank);
  if (slab.box.i1 < block.ni) return 0;
  return checksumOfRow(slab.block, j, k, {row.x.value(), row.y.value(), row.z.value(), row.blank.value()});
}

}  // namespace curvisplat
