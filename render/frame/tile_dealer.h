// Deals a picture's tiles out to the ranks that draw it together (picture_shares.h), each of which paints its own; and to
// the regions that one rank draws one by one (frame_regions.h). Each rank or region gets a rectangle of shared tiles
// (render/project/tile_set.h), so that few splats are painted by several. Costs are estimated from the index alone:
//
//   preparing   a part costs its preparer as much as it has splats
//   painting    a splat is sorted by each rank that paints some of it, and each of its pixels painted by one; a brick's splats
//               are spread evenly over its box, and the larger they are, the more a splat costs
//
// The picture is halved again and again (a k-d tree), each time where the costs of both sides, by the ranks that they
// get, are most alike. What splats hide of each other is not known beforehand.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/frame/part_cost.h"
#include "render/frame/sweep_buffer.h"
#include "render/image/image_size.h"
#include "render/project/screen_view.h"
#include "render/project/tile_set.h"
#include "stream/model/brick.h"

namespace curvisplat {

/// Of the parts of a plan.
std::vector<PartCost> partCosts(std::span<const SweptPart> parts, std::span<const Brick> bricks,
                                std::span<const BrickVariable> variables, const ScreenView& view);

struct TileDealing {
  TileBox box;                 // the tiles that are dealt out
  int unit = 1;                // rectangles are cut at multiples of it, in tiles of the picture
  bool each_prepares = false;  // a part costs its preparing for each rectangle that it touches, as regions do
};

/// [shared tile] the rank that draws it. Ranks may get nothing if there are more of them than tiles. The picture's other
/// tiles get kNobody.
std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, const TileDealing& how,
                                uint32_t ranks);
/// All tiles, by what each costs, wherever its neighbours are painted.   tile_costs [shared tile]
std::vector<uint32_t> dealTiles(std::span<const double> tile_costs, ImageSize size, uint32_t ranks);
/// [shared tile] sorting and painting the splats in it, and the tile itself.
std::vector<double> tileCosts(std::span<const PartCost> parts, ImageSize size);

}  // namespace curvisplat
