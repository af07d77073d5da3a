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

namespace vdb_plugin {

std::vector<std::byte> brickGridsFile(const RootCube& root, std::span<const Brick> bricks);
uint64_t brickGridsMemory(std::span<const Brick> bricks);
BrickGridsComparison compareBrickGrids(std::span<const std::byte> bytes, const RootCube& root,
                                       std::span<const Brick> bricks, uint64_t most_memory);
std::unique_ptr<CountingGrid> makeCountingGrid(uint32_t level, uint64_t memory_bytes);
std::unique_ptr<FogVolume> makeFogVolume(const glm::dvec3& origin, double side);

}  // namespace vdb_plugin
}  // namespace curvisplat
