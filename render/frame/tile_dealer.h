// Deals the tiles of a picture out to the ranks that draw it together, or to the regions that are drawn one by one
// (frame_regions.h). Each gets a rectangle of tiles, so that few bricks are read by several.
//
// The picture is halved again and again (a k-d tree), each time where the estimated costs of both sides, by the
// ranks that they get, are most alike. Costs are estimated from the index alone:
//
//   preparing   a brick costs the same for each rank that draws any of it: all of its splats
//   painting    a splat costs its share of the tiles; a brick's splats are spread evenly over its box
//
// What splats hide of each other is not known beforehand.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/frame/sweep_buffer.h"
#include "render/image/image_size.h"
#include "render/project/screen_box.h"
#include "render/project/screen_view.h"
#include "render/project/tile_set.h"
#include "stream/model/brick.h"

namespace curvisplat {

/// What drawing a part of the cut takes, in units of preparing one splat.
struct PartCost {
  ScreenBox box;       // in pixels
  double prepare = 0;  // for each rank
  double paint = 0;    // for all of the box
  uint64_t bytes = 0;  // to be read by each rank
};

/// Of the parts of a plan.
std::vector<PartCost> partCosts(std::span<const SweptPart> parts, std::span<const Brick> bricks,
                                std::span<const BrickVariable> variables, const ScreenView& view);

/// [tile] the rank that draws it. Ranks may get nothing if there are more of them than tiles. Of a picture's tiles
/// those in `box` are dealt out; the others get kNobody.
inline constexpr uint32_t kNobody = UINT32_MAX;
std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, const TileBox& box,
                                uint32_t ranks);
/// All tiles.
std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, uint32_t ranks);

/// What one rank has to do.
struct RankWork {
  double cost = 0;      // prepare and paint
  uint64_t bytes = 0;   // read from the cache
  uint64_t bricks = 0;  // read
  uint64_t pixels = 0;  // sent to rank 0
};

/// [rank] of tiles that were dealt out.
std::vector<RankWork> workOfRanks(std::span<const PartCost> parts, ImageSize size,
                                  const std::vector<uint32_t>& owners, uint32_t ranks);

}  // namespace curvisplat
