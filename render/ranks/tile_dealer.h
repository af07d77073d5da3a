// Deals a picture's tiles out to the ranks that draw it together (picture_shares.h), each of which paints
// its own; and to the regions that one rank draws one by one (render/frame/frame_memory.h). Each rank or
// region gets a rectangle of shared tiles (render/project/tile_set.h), so that few splats are painted by
// several. Costs are estimated from the index alone:
//
//   preparing   a part costs its preparer as much as it has splats
//   painting    a splat is sorted by each rank that paints some of it, and each of its pixels painted by
//               one; a brick's splats are spread evenly over its box, and the larger they are, the more a
//               splat costs
//
// The picture is halved again and again (a k-d tree), each time where the costs of both sides, by the ranks
// that they get, are most alike. What splats hide of each other is not known beforehand. A million parts
// take seconds. Pure; any thread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "render/image/image.h"
#include "render/project/screen_view.h"
#include "render/project/tile_set.h"
#include "render/sweep/sweep_buffer.h"
#include "stream/model/octree.h"

namespace curvisplat {

/// The estimated cost of drawing a part of the cut; 1 is the cost of preparing one splat.
struct PartCost {
  ScreenBox box;       // in pixels
  double prepare = 0;  // for one rank
  double paint = 0;    // for all pixels, wherever they are painted
  uint64_t bytes = 0;  // to be read by the rank that prepares it
  double splats = 0;
  double reach_px = 0;  // about how far a splat reaches beyond its centre
  double sort = 0;      // for each rank that paints all splats; a rank that paints some has its share
};

/// The costs of a plan's parts.
std::vector<PartCost> partCosts(std::span<const SweptPart> parts, std::span<const Brick> bricks,
                                std::span<const BrickVariable> variables, const ScreenView& view);

struct TileDealing {
  TileBox box;                 // the tiles that are dealt out
  int unit = 1;                // rectangles are cut at multiples of it, in tiles of the picture
  bool each_prepares = false;  // a part costs its preparing for each rectangle that it touches, as regions do
};

/// Deals out the tiles by the costs of parts: [shared tile] the rank that draws it. Ranks may get nothing if
/// there are more of them than tiles. The picture's other tiles get kNobody.
std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, const TileDealing& how,
                                uint32_t ranks);
/// Deals out all tiles by what each costs, wherever its neighbours are painted.   tile_costs [shared tile]
std::vector<uint32_t> dealTiles(std::span<const double> tile_costs, ImageSize size, uint32_t ranks);
/// The costs of tiles: [shared tile] sorting and painting the splats in it, and the tile itself.
std::vector<double> tileCosts(std::span<const PartCost> parts, ImageSize size);

// Costs of tiles and splats for their painter, and a part as shared tiles see it: for this dealer and that of
// parts (picture_shares.cpp) only.

// Nanoseconds by nanoseconds of one core, of a brick in memory (bench/README.md, "Several processes"):
// decoding and projecting a splat take 1, sorting it and finding its pixels kSortPerPrepare, painting those
// kPaintPerPixel by the square of its reach in pixels; clearing and resolving a tile costs as much as
// painting 300 splats for each painter's tile of pixels.
inline constexpr double kSortPerPrepare = 1.4, kPaintPerPixel = 0.06;
// Costs of a splat: finding out who gets it and copying it for others; taking it from another's message, or
// from this rank's own parts.
inline constexpr double kSendCost = 0.25, kReceiveCost = 0.25, kKeepCost = 0.1;
inline constexpr double kTileCost = 300.0 * kSharedTileSide * kSharedTileSide / (kTileSide * kTileSide);

/// A part of the cut in units of shared tiles, within the picture.
struct TilePart {
  double x0, y0, x1, y1;
  double prepare;
  double paint, sort, splats;  // of a tile
  double reach;                // how far beyond a border splats are sorted

  static TilePart of(const PartCost& cost, ImageSize size) {
    const auto tiles = [](float pixel, int pixels) {
      return std::clamp<double>(pixel / kSharedTileSide, 0, TileSet::tilesAlong(pixels, kSharedTileSide));
    };
    const ScreenBox& box = cost.box;
    TilePart part{tiles(box.x0, size.width),
                  tiles(box.y0, size.height),
                  tiles(box.x1, size.width),
                  tiles(box.y1, size.height),
                  cost.prepare,
                  0,
                  0,
                  0,
                  (cost.reach_px + TileSet::kMargin) / kSharedTileSide};
    // A box without bounds, around the eye: its splats are taken to lie in the picture.
    double tiles_of_box =
        (double{box.x1} - box.x0) * (double{box.y1} - box.y0) / (kSharedTileSide * kSharedTileSide);
    if (!std::isfinite(tiles_of_box)) tiles_of_box = (part.x1 - part.x0) * (part.y1 - part.y0);
    part.paint = cost.paint / tiles_of_box;
    part.splats = cost.splats / tiles_of_box;
    part.sort = cost.sort / tiles_of_box;
    return part;
  }
  bool isSeen() const { return x0 < x1 && y0 < y1; }

  double along(bool vertical, double from, double to) const {
    return std::max(0.0, std::min(to, vertical ? y1 : x1) - std::max(from, vertical ? y0 : x0));
  }
};

}  // namespace curvisplat
