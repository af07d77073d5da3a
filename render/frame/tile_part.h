// A part of the cut as the shared tiles of the picture see it, and what tiles and splats cost their painter
// (tile_dealer.h). For the dealers of tiles and parts only.
#pragma once

#include <algorithm>
#include <cmath>

#include "render/frame/part_cost.h"
#include "render/image/image_size.h"
#include "render/project/tile_set.h"

namespace curvisplat {

// Nanoseconds by nanoseconds of one core, of a brick in memory (bench/README.md, "Several processes"): decoding and
// projecting a splat take 1, sorting it and finding its pixels kSortPerPrepare, painting those kPaintPerPixel by the square of
// its reach in pixels; clearing and resolving a tile costs as much as painting 300 splats for each painter's tile of pixels.
inline constexpr double kSortPerPrepare = 1.4, kPaintPerPixel = 0.06;
// Of a splat: finding out who gets it and copying it for others; taking it from another's message, or from this rank's own parts.
inline constexpr double kSendCost = 0.25, kReceiveCost = 0.25, kKeepCost = 0.1;
inline constexpr double kTileCost = 300.0 * kSharedTileSide * kSharedTileSide / (kTileSide * kTileSide);

/// In units of shared tiles, within the picture.
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
