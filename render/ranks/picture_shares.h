// How ranks share a picture that they draw together: each tile has a rank that paints it (tile_dealer.h),
// and each part of the cut one that prepares it and sends its splats to those that paint them
// (splat_exchange.h). What that takes each of them is estimated by the same costs. In the end joinTiles()
// brings the tiles together at rank 0.
//
// A rank prepares as much as makes its preparing and painting together those of the others: who paints much
// prepares little. Parts are dealt out in rounds of neighbours in the sweep's order, since what all wait for
// comes in that order. In a round each rank gets its share, and each part goes to the rank that paints most
// of its splats, if that rank's share of the round is not full; first the parts of which one rank paints
// many splats. Then it is known what each rank's tiles take it, with the splats of its neighbours that reach
// into them; tiles and parts are dealt out again by that, some times, and the shares that take least time
// count.
//
// The same costs give the same shares on any processor of one instruction set; so rank 0 shares the picture,
// and sends the result to the others. All is pure but joinTiles(), which all ranks call at the same time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/image/image.h"
#include "render/ranks/tile_dealer.h"
#include "stream/base/ranks.h"

namespace curvisplat {

struct PictureShares {
  std::vector<uint32_t> owners;     // [shared tile] the rank that paints it
  std::vector<uint32_t> preparers;  // [part] a rank
};

/// Shares a picture among ranks. `parts` are in the sweep's order.
PictureShares sharePicture(std::span<const PartCost> parts, ImageSize size, uint32_t ranks);
/// The ends of the rounds in which `parts` are prepared, each the number of parts before it. Rounds become
/// smaller, since nothing is left to prepare while the last one is painted. Each rank prepares some parts in
/// every round.
std::vector<size_t> roundEnds(size_t parts, uint32_t ranks);

/// The work of one rank.
struct RankWork {
  double prepare = 0;          // and send
  double paint = 0;            // and receive
  uint64_t bytes = 0;          // read from the cache
  uint64_t bricks = 0;         // read
  uint64_t pixels = 0;         // sent to rank 0
  double splats = 0;           // painted
  double splats_received = 0;  // of other ranks
};

struct SharedWork {
  std::vector<RankWork> ranks;
  /// The time until the last rank is done, if all wait after each round until all have prepared theirs, and
  /// paint what they have got while they wait, or afterwards.
  double longest = 0;
};

/// The work of ranks on a picture that sharePicture() has shared out.
SharedWork workOfRanks(std::span<const PartCost> parts, ImageSize size, uint32_t ranks);

/// Brings the tiles that ranks have drawn together: completes the image at rank 0. All ranks have to call
/// it. `owners` [shared tile]: its rank. Takes 16 bytes a pixel at rank 0.
void joinTiles(Image& image, const std::vector<uint32_t>& owners, Ranks& ranks);

}  // namespace curvisplat
