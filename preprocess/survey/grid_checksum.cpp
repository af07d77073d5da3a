#include "preprocess/survey/grid_checksum.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <array>
#include <functional>
#include <span>

#include "stream/base/checksum.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr uint64_t kNodesPerTask = 16384;

}  // namespace

uint64_t checksumOfGrid(const LoadedSlab& loaded, const GridBlock& block) {
  const Slab& slab = loaded.slab;
  const NodeArrays& nodes = loaded.nodes;
  const uint64_t rows = slab.box.j1 - slab.box.j0, window_rows = slab.window.j1 - slab.window.j0;
  const auto of_row = [&](uint64_t row) {
    const uint64_t j = slab.box.j0 + row % rows, k = slab.box.k0 + row / rows;
    const size_t first = ((k - slab.window.k0) * window_rows + (j - slab.window.j0)) * block.ni;
    const auto of_axis = [&](const std::vector<double>& axis) {
      return checksumOf(std::as_bytes(std::span(axis).subspan(first, block.ni)));
    };
    const std::array<uint64_t, 7> parts{
        slab.block,
        j,
        k,
        of_axis(nodes.x),
        of_axis(nodes.y),
        of_axis(nodes.z),
        checksumOf(std::as_bytes(std::span(nodes.blank).subspan(first, block.ni)))};
    return checksumOf(std::as_bytes(std::span(parts)));
  };
  return tbb::parallel_reduce(
      tbb::blocked_range<uint64_t>(0, rowsOf(slab.box), kNodesPerTask / block.ni + 1), uint64_t{0},
      [&](const tbb::blocked_range<uint64_t>& range, uint64_t sum) {
        const TraceScope trace("checksum");
        for (uint64_t row = range.begin(); row < range.end(); ++row) sum += of_row(row);
        return sum;
      },
      std::plus<>());
}

}  // namespace curvisplat
