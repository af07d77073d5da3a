// Deals a picture out to the ranks that draw it together: the parts of bricks, each of which one rank prepares, and the
// tiles, each of which one rank paints. Tiles are dealt out in the same way to the regions that one rank draws one by one
// (frame_regions.h). Each rank or region gets a rectangle of shared tiles (render/project/tile_set.h), so that few splats
// are painted by several. Costs are estimated from the index alone:
//
//   preparing   a part costs its preparer as much as it has splats
//   exchanging  each splat that a rank gets
//   painting    a splat costs its share of the tiles; a brick's splats are spread evenly over its box. Those near the
//               border of a rank's tiles cost its neighbour the same
//
// Parts are dealt out in rounds of neighbours in the sweep's order: the largest first, each to the rank that has least.
// The picture is halved again and again (a k-d tree), each time where the costs of both sides, by the ranks that they
// get, are most alike. What splats hide of each other is not known beforehand.
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
  double prepare = 0;  // for one rank
  double paint = 0;    // for all of the box
  uint64_t bytes = 0;  // to be read by the rank that prepares it
  double splats = 0;
  double reach_px = 0;  // about how far a splat reaches beyond its centre
};

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
/// All tiles.
std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, uint32_t ranks);

/// [part] the rank that prepares it.
std::vector<uint32_t> dealParts(std::span<const PartCost> parts, uint32_t ranks);
/// How many parts, one after the other, are a round of dealParts().
size_t partsARound(uint32_t ranks);

/// What one rank has to do.
struct RankWork {
  double prepare = 0, paint = 0;  // paint: and exchange
  uint64_t bytes = 0;             // read from the cache
  uint64_t bricks = 0;            // read
  uint64_t pixels = 0;            // sent to rank 0
  double splats = 0;              // painted
  double splats_received = 0;     // of other ranks
};

struct SharedWork {
  std::vector<RankWork> ranks;
  /// Until the last rank is done, if all wait for each other after each round of parts, and paint what they have got
  /// meanwhile or then.
  double longest = 0;
};

/// Of tiles and parts that were dealt out.
SharedWork workOfRanks(std::span<const PartCost> parts, ImageSize size, uint32_t ranks);

}  // namespace curvisplat
