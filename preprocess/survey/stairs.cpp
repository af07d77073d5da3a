#include "preprocess/survey/stairs.h"

#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>
#include <limits>

#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"

namespace curvisplat {
namespace {

constexpr uint64_t kStairNodesAtOnce = 1 << 18;

/// Whether the cells around a node, by its number in bits along i, j, k, end at no plane: some are missing, and the others are not
/// those on one side of it.
bool isAtStairs(unsigned cells) {
  for (const unsigned side : {0xffu, 0xaau, 0xccu, 0xf0u, 0x55u, 0x33u, 0x0fu, 0u})
    if (cells == side) return false;
  return true;
}

/// How many of a block's inner nodes lie at stairs of blanked ones.
struct Stairs {
  uint64_t nodes = 0, at_stairs = 0;
  glm::dvec3 lower{std::numeric_limits<double>::infinity()}, upper{-lower};  // the box of these nodes

  void add(const NodeArrays& nodes_around, const std::array<size_t, 3>& strides, size_t at) {
    if (nodes_around.blank[at] != 0) return;
    ++nodes;
    const glm::dvec3 place(nodes_around.x[at], nodes_around.y[at], nodes_around.z[at]);
    lower = glm::min(lower, place);
    upper = glm::max(upper, place);
    unsigned there = 0;
    for (unsigned cell = 0; cell < 8; ++cell) {
      bool whole = true;
      for (unsigned corner = 0; corner < 8; ++corner) {
        size_t node = at;
        for (unsigned axis = 0; axis < 3; ++axis)
          if ((corner >> axis & 1) != 0) node += (cell >> axis & 1) != 0 ? strides[axis] : 0 - strides[axis];
        whole = whole && nodes_around.blank[node] == 0;
      }
      there |= whole ? 1u << cell : 0;
    }
    if (isAtStairs(there)) ++at_stairs;
  }
  /// at_stairs must not be 0.
  double share() const { return static_cast<double>(at_stairs) / static_cast<double>(nodes); }
  /// Whether the boxes meet. Those of blocks that only touch do not, as these nodes lie within the blocks.
  bool meets(const Stairs& other) const {
    return glm::all(glm::lessThanEqual(glm::max(lower, other.lower), glm::min(upper, other.upper)));
  }
};

/// Whether another block may be drawn where this one is blanked: finer cells above coarser ones, or around a body.
bool mayBeFilled(const Stairs& one, const std::vector<Stairs>& of_blocks) {
  return std::ranges::any_of(of_blocks,
                             [&](const Stairs& other) { return &other != &one && one.meets(other); });
}

std::vector<Stairs> stairsOf(const GridSource& source, std::vector<uint32_t> scalars,
                             std::optional<double> blank_value) {
  const GridDescription& description = source.description();
  constexpr size_t kMaxScalars = 16;  // of which values are in memory
  std::erase_if(scalars, [&](uint32_t n) { return description.scalars.at(n).centring != Centring::kNode; });
  scalars.resize(std::min(scalars.size(), kMaxScalars));
  const NodeReader reader = NodeReader::ofAnyValue(source, scalars, blank_value);
  SlabStream stream(reader, kStairNodesAtOnce * slabBytesPerNode(scalars.size()),
                    cutIntoSlabs(description.blocks, kStairNodesAtOnce, kNodeHalo));
  std::vector<Stairs> of_blocks(description.blocks.size());
  while (const LoadedSlab* loaded = stream.next()) {
    const Slab& slab = loaded->slab;
    const GridBlock& block = description.blocks[slab.block];
    const WindowStrides strides(slab.window, block.ni);
    for (uint64_t k = std::max<uint64_t>(slab.box.k0, 1); k < std::min(slab.box.k1, block.nk - 1); ++k)
      for (uint64_t j = std::max<uint64_t>(slab.box.j0, 1); j < std::min(slab.box.j1, block.nj - 1); ++j)
        for (uint64_t i = std::max<uint64_t>(slab.box.i0, 1);
             i < std::min(slab.box.endOfRow(block.ni), block.ni - 1); ++i)
          of_blocks[slab.block].add(loaded->nodes, {1, strides.row, strides.plane}, strides.at(i, j, k));
  }
  return of_blocks;
}

}  // namespace

std::vector<double> shareAtStairs(const GridSource& source, const std::vector<uint32_t>& scalars,
                                  std::optional<double> blank_value) {
  std::vector<double> shares(source.description().blocks.size());
  try {
    const std::vector<Stairs> of_blocks = stairsOf(source, scalars, blank_value);
    for (size_t block = 0; block < shares.size(); ++block)
      if (of_blocks[block].at_stairs > 0 && !mayBeFilled(of_blocks[block], of_blocks))
        shares[block] = of_blocks[block].share();
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {  // the conversion says so
  }
  return shares;
}

}  // namespace curvisplat
