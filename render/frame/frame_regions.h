// Divides a picture into regions that are drawn one after the other, where the memory of the sweep cannot hold a layer of
// the whole cut (sweep_buffer.h). Where ranks draw a picture together, each divides its own tiles. A region is a rectangle of
// whole tiles of the painters (except where a rank's tiles end), whose layer is as much smaller as the region is. A brick on a border between regions is prepared for each of them; without regions, one that reaches through several slabs of
// depth would be prepared for each slab, which are many more: a brick is deep compared with a slab, and small compared
// with the picture.
//
// The number of regions is the one with the least estimated work. Estimates come from the index alone; if a layer is larger
// than expected, its region is drawn in slabs. Regions change no bit of the picture: a pixel's bits depend on nothing but
// its splats and their order.
//
// Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "render/frame/frame_plan.h"
#include "render/project/tile_set.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

struct FrameRegion {
  std::shared_ptr<const TileSet> tiles;  // null: all of the picture, drawn by one process
  std::vector<uint8_t> left_out;  // [part of the plan] 1: touches none of them; empty: no part is left out
};

/// One region at least; together they have the plan's tiles, each once. `sweep_splats`: what the sweep can hold.
std::vector<FrameRegion> frameRegions(const FramePlan& plan, const CacheReader& cache, size_t variable,
                                      size_t sweep_splats);

/// A part of the cut in a region: how many of its splats are there, and their depth keys, which are taken to lie evenly in
/// between.
struct PartInRegion {
  KeyRange keys;
  double splats = 0;   // in the region
  double prepare = 0;  // to be prepared for it: all
};

/// The most splats that a sweep over the parts holds at a time. `parts` in the sweep's order.
double largestLayer(const std::vector<PartInRegion>& parts);

}  // namespace curvisplat
