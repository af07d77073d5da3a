// Loads OpenVDB. It is linked by a plug-in, curvisplat-vdb.so (tools/vdb), which is loaded when something is first counted,
// written or compared with it: libopenvdb.so has so many relocations that each start of the program took 45 ms longer.
//
// The functions of brick_grids.h, counting_grid.h and fog_volume.h call those of the plug-in. They throw Error if it cannot be
// loaded. Any thread.
#pragma once

#include "stream/vdb/brick_grids.h"
#include "stream/vdb/counting_grid.h"
#include "stream/vdb/fog_volume.h"

namespace curvisplat {

/// The functions that the plug-in provides.
struct VdbFunctions {
  decltype(&brickGridsFile) brick_grids_file;
  decltype(&brickGridsMemory) brick_grids_memory;
  decltype(&compareBrickGrids) compare_brick_grids;
  decltype(&makeCountingGrid) make_counting_grid;
  decltype(&makeFogVolume) make_fog_volume;
};

}  // namespace curvisplat
