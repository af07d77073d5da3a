// What drawing a part of the cut takes, as the dealers of tiles and parts estimate it (tile_dealer.h).
#pragma once

#include <cstdint>

#include "render/project/screen_box.h"

namespace curvisplat {

/// In units of preparing one splat.
struct PartCost {
  ScreenBox box;       // in pixels
  double prepare = 0;  // for one rank
  double paint = 0;    // for all pixels, wherever they are painted
  uint64_t bytes = 0;  // to be read by the rank that prepares it
  double splats = 0;
  double reach_px = 0;  // about how far a splat reaches beyond its centre
  double sort = 0;      // for each rank that paints all splats; a rank that paints some has its share
};

}  // namespace curvisplat
