// The functions of curvisplat-vdb.so. The functions that load it and call them (brick_grids.h, counting_grid.h,
// fog_volume.h) have the same names, in another namespace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stream/vdb/vdb_library.h"

namespace curvisplat {

/// Registers OpenVDB's types, which reading and writing grids needs. Any thread, any number of times.
void initializeOpenVdb();

/// Deletes a tree's nodes one by one. A tree's destructor first lists them, and ends the process where there is no memory left for
/// the list. To be called before it; the tree's accessors are no longer valid.
template <typename Tree>
void deleteNodes(Tree& tree) noexcept {
  tree.root().clear();
}

/// A grid without values, whose nodes are deleted as by deleteNodes().
template <typename Grid>
typename Grid::Ptr makeVdbGrid(typename Grid::ValueType background) {
  return typename Grid::Ptr(new Grid(background), [](Grid* grid) {
    deleteNodes(grid->tree());
    delete grid;
  });
}

namespace vdb_plugin {

std::vector<std::byte> brickGridsFile(const RootCube& root, std::span<const Brick> bricks);
uint64_t brickGridsMemory(std::span<const Brick> bricks);
BrickGridsComparison compareBrickGrids(std::span<const std::byte> bytes, const RootCube& root,
                                       std::span<const Brick> bricks, uint64_t most_memory);
std::unique_ptr<CountingGrid> makeCountingGrid(uint32_t level, uint64_t memory_bytes);
std::unique_ptr<FogVolume> makeFogVolume(const glm::dvec3& origin, double side);

}  // namespace vdb_plugin
}  // namespace curvisplat
