#include "preprocess/grid/slabs.h"

#include <algorithm>
#include <cmath>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// With fewer planes than this besides the halo's two, strips re-read fewer rows than slabs of whole planes.
constexpr uint64_t kMinPlanes = 4;

/// The number of rows along j and planes along k of a box whose window has at most `window_rows` rows.
struct Extent {
  uint64_t j, k;
};

/// `margin`: rows of the halo, the sum of both sides.
Extent extentWithin(const GridBlock& block, uint64_t window_rows, uint64_t margin) {
  const uint64_t planes = window_rows / block.nj;
  if (planes >= block.nk) return {block.nj, block.nk};
  if (planes >= kMinPlanes + margin) return {block.nj, planes - margin};
  const auto side = static_cast<uint64_t>(std::sqrt(static_cast<double>(window_rows)));
  const uint64_t k = std::min(side, block.nk);
  const uint64_t j = std::min(window_rows / k, block.nj);
  return {j - std::min(j - 1, margin), k - std::min(k - 1, margin)};
}

/// The rows of the smallest window that is not cut any further.
uint64_t leastRows(const GridBlock& block, Halo halo) {
  const uint64_t side = halo.before + 1 + halo.after;
  return std::min(side * side, block.nj * block.nk);
}

}  // namespace

uint64_t leastSlabBytes(const std::vector<GridBlock>& blocks, size_t scalars, Halo halo) {
  uint64_t nodes = 0;
  for (const GridBlock& block : blocks) nodes = std::max(nodes, leastRows(block, halo) * block.ni);
  return nodes * slabBytesPerNode(scalars);
}

std::vector<Slab> cutIntoSlabs(const std::vector<GridBlock>& blocks, uint64_t window_nodes, Halo halo) {
  const uint64_t margin = halo.before + halo.after;
  std::vector<Slab> slabs;
  uint64_t first_node = 0;
  for (uint32_t number = 0; number < blocks.size(); ++number) {
    const GridBlock& block = blocks[number];
    const uint64_t rows = window_nodes / std::max<uint64_t>(block.ni, 1);
    if (rows < leastRows(block, halo))
      throw Error("{}: {} rows of {} nodes along i do not fit in memory; increase --memory", block.name,
                  leastRows(block, halo), block.ni);
    const Extent extent = extentWithin(block, rows, margin);
    for (uint64_t k = 0; k < block.nk; k += extent.k) {
      for (uint64_t j = 0; j < block.nj; j += extent.j) {
        const NodeBox box{j, std::min(j + extent.j, block.nj), k, std::min(k + extent.k, block.nk)};
        const NodeBox window{box.j0 - std::min(box.j0, halo.before), std::min(box.j1 + halo.after, block.nj),
                             box.k0 - std::min(box.k0, halo.before), std::min(box.k1 + halo.after, block.nk)};
        slabs.push_back({number, first_node, box, window});
      }
    }
    first_node += block.nodes();
  }
  return slabs;
}

std::vector<NodeBox> cutForTasks(const GridBlock& block, const NodeBox& box, uint64_t nodes) {
  const uint64_t rows = std::max<uint64_t>(1, nodes / std::max<uint64_t>(1, block.ni));
  const uint64_t planes = std::max<uint64_t>(1, rows / (box.j1 - box.j0));
  const uint64_t strip = std::min(rows, box.j1 - box.j0);
  std::vector<NodeBox> tasks;
  for (uint64_t k = box.k0; k < box.k1; k += planes)
    for (uint64_t j = box.j0; j < box.j1; j += strip)
      tasks.push_back({j, std::min(j + strip, box.j1), k, std::min(k + planes, box.k1)});
  return tasks;
}

SlabStream::SlabStream(const NodeReader& reader, uint64_t slab_bytes, Halo halo, const SlabShare& share)
    : SlabStream(reader, slab_bytes,
                 leastSlabBytes(reader.source().description().blocks, reader.scalars(), halo), halo, share) {}

SlabStream::SlabStream(const NodeReader& reader, uint64_t slab_bytes, uint64_t least_bytes, Halo halo,
                       const SlabShare& share)
    : slabs_(cutIntoSlabs(
          reader.source().description().blocks,
          (least_bytes > slab_bytes ? kSlabsOfLongRows : 1) * slab_bytes / slabBytesPerNode(reader.scalars()),
          halo)),
      position_(slabs_.size() * share.index / share.count),
      end_(slabs_.size() * (share.index + 1) / share.count),
      ahead_(
          [this, &reader](LoadedSlab& loaded) {
            if (position_ == end_) return false;
            loaded.slab = slabs_[position_++];
            loaded.blanked = reader.read(loaded.slab.block, loaded.slab.window, loaded.nodes);
            return true;
          },
          least_bytes > slab_bytes ? 1 : 2) {}

}  // namespace curvisplat
