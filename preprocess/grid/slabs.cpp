#include "preprocess/grid/slabs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/memory.h"

namespace curvisplat {
namespace {

/// Planes besides the halo's two below which strips re-read fewer rows than slabs of whole planes.
constexpr uint64_t kMinPlanes = 4;

/// The nodes along i, j and k of the box of a slab.
struct Extent {
  uint64_t i, j, k;
};

/// The extent of slabs of whole rows whose windows have at most `window_rows` rows. `margin`: rows of the
/// halo, the sum of both sides.
Extent extentOfRows(const GridBlock& block, uint64_t window_rows, uint64_t margin) {
  const uint64_t planes = window_rows / block.nj;
  if (planes >= block.nk) return {block.ni, block.nj, block.nk};
  if (planes >= kMinPlanes + margin) return {block.ni, block.nj, planes - margin};
  const auto side = static_cast<uint64_t>(std::sqrt(static_cast<double>(window_rows)));
  const uint64_t k = std::min(side, block.nk);
  const uint64_t j = std::min(window_rows / k, block.nj);
  return {block.ni, j - std::min(j - 1, margin), k - std::min(k - 1, margin)};
}

/// The extent of slabs of parts of rows.
Extent extentOfParts(const GridBlock& block, uint64_t window_nodes, uint64_t margin) {
  if (margin == 0) return {std::max<uint64_t>(1, window_nodes), 1, 1};
  const auto nodes = static_cast<double>(window_nodes);
  const uint64_t k = std::min(static_cast<uint64_t>(std::cbrt(nodes)), block.nk);
  const auto side = static_cast<uint64_t>(std::sqrt(nodes / static_cast<double>(std::max<uint64_t>(1, k))));
  const uint64_t j = std::min(side, block.nj);
  const uint64_t i = std::min(window_nodes / std::max<uint64_t>(1, j * k), block.ni);
  const auto within = [&](uint64_t count, uint64_t all) {
    if (count < std::min(margin + 1, all))
      throw Error("{}: not even a node and its neighbours fit in memory; increase --memory", block.name);
    return count == all ? all : count - margin;
  };
  return {within(i, block.ni), within(j, block.nj), within(k, block.nk)};
}

/// The rows of the smallest window that is not cut any further.
uint64_t leastRows(const GridBlock& block, Halo halo) {
  const uint64_t side = halo.before + 1 + halo.after;
  return std::min(side * side, block.nj * block.nk);
}

/// Reserves memory for as many nodes, in large pages. Elements may be lost.
void makeRoom(size_t count, size_t scalars, NodeArrays& nodes) {
  const auto make = [&](auto& values) {
    if (values.capacity() >= count) return;
    values.clear();
    values.reserve(count);
    preferHugePages(values.data(), count * sizeof(values[0]));
  };
  for (auto* axis : {&nodes.x, &nodes.y, &nodes.z}) make(*axis);
  make(nodes.blank);
  nodes.scalars.resize(scalars);
  for (auto& values : nodes.scalars) make(values);
}

/// Nodes of the slab's window.
uint64_t nodesOf(const Slab& slab, uint64_t ni) {
  return rowsOf(slab.window) * slab.window.rowNodes(ni);
}

std::vector<Slab> shareOf(std::vector<Slab> slabs, const SlabShare& share) {
  const auto begin_of = [&](unsigned index) {
    size_t begin = slabs.size() * index / share.count;
    while (share.whole_rows && begin < slabs.size() && slabs[begin].box.i0 > 0) ++begin;
    return begin;
  };
  const size_t begin = begin_of(share.index), end = begin_of(share.index + 1);
  slabs.resize(end);
  slabs.erase(slabs.begin(), slabs.begin() + static_cast<ptrdiff_t>(begin));
  return slabs;
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
    const Extent extent = rows < leastRows(block, halo) ? extentOfParts(block, window_nodes, margin)
                                                        : extentOfRows(block, rows, margin);
    const auto before = [&](uint64_t index) { return index - std::min(index, halo.before); };
    for (uint64_t k = 0; k < block.nk; k += extent.k)
      for (uint64_t j = 0; j < block.nj; j += extent.j)
        for (uint64_t i = 0; i < block.ni; i += extent.i) {
          const NodeBox box{j, std::min(j + extent.j, block.nj), k, std::min(k + extent.k, block.nk),
                            i, std::min(i + extent.i, block.ni)};
          const NodeBox window{before(j), std::min(box.j1 + halo.after, block.nj),
                               before(k), std::min(box.k1 + halo.after, block.nk),
                               before(i), std::min(box.i1 + halo.after, block.ni)};
          slabs.push_back({number, first_node, box, window});
        }
    first_node += block.nodes();
  }
  return slabs;
}

std::vector<NodeBox> cutForTasks(uint64_t row_nodes, const NodeBox& box, uint64_t nodes) {
  const uint64_t rows = std::max<uint64_t>(1, nodes / std::max<uint64_t>(1, row_nodes));
  const uint64_t planes = std::max<uint64_t>(1, rows / (box.j1 - box.j0));
  const uint64_t strip = std::min(rows, box.j1 - box.j0);
  std::vector<NodeBox> tasks;
  for (uint64_t k = box.k0; k < box.k1; k += planes)
    for (uint64_t j = box.j0; j < box.j1; j += strip)
      tasks.push_back({j, std::min(j + strip, box.j1), k, std::min(k + planes, box.k1), box.i0, box.i1});
  return tasks;
}

SlabStream::SlabStream(const NodeReader& reader, const SlabBuffers& buffers, Halo halo,
                       const SlabShare& share)
    : SlabStream(reader, buffers,
                 shareOf(cutIntoSlabs(reader.source().description().blocks,
                                      buffers.slab_bytes / slabBytesPerNode(reader.scalars()), halo),
                         share)) {}

SlabStream::SlabStream(const NodeReader& reader, const SlabBuffers& buffers, std::vector<Slab> slabs)
    : slabs_(std::move(slabs)),
      ends_(endsOfGroups(slabs_, reader.source().description().blocks)),
      ahead_(
          [this, &reader](Group& group, uint64_t number) {
            if (number >= ends_.size()) return false;
            const size_t begin = number == 0 ? 0 : ends_[number - 1];
            group.count = ends_[number] - begin;
            if (group.slabs.size() < group.count) group.slabs.resize(group.count);
            for (size_t n = 0; n < group.count; ++n) {
              LoadedSlab& loaded = group.slabs[n];
              loaded.slab = slabs_[begin + n];
              const uint64_t ni = reader.source().description().blocks[loaded.slab.block].ni;
              makeRoom(nodesOf(loaded.slab, ni), reader.scalars(), loaded.nodes);
              loaded.blanked = reader.read(loaded.slab.block, loaded.slab.window, loaded.nodes);
            }
            return true;
          },
          buffers.readers) {}

std::vector<size_t> SlabStream::endsOfGroups(std::span<const Slab> slabs, std::span<const GridBlock> blocks) {
  // A group's arrays are kept for the next: these few take little, whatever the limit of slabs is.
  constexpr size_t kMaxSlabs = 64;
  constexpr uint64_t kSmallNodes = 1024;
  std::vector<size_t> ends;
  size_t begin = 0;
  bool is_small = false;
  for (size_t n = 0; n < slabs.size(); ++n) {
    const bool was_small =
        std::exchange(is_small, nodesOf(slabs[n], blocks[slabs[n].block].ni) <= kSmallNodes);
    if (n == begin || (was_small && is_small && n - begin < kMaxSlabs)) continue;
    ends.push_back(n);
    begin = n;
  }
  if (begin < slabs.size()) ends.push_back(slabs.size());
  return ends;
}

const LoadedSlab* SlabStream::next() {
  if (!group_ || next_ == group_->count) {
    group_ = ahead_.next();
    next_ = 0;
    if (!group_) return nullptr;
  }
  return &group_->slabs[next_++];
}

}  // namespace curvisplat
