// TileLists sorts the splats of a painter's tile (32x32 pixels) for each of its order tiles (4x4 pixels):
// those that touch the order tile, in the order of their keys there (tile_key.h).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/project/screen_splat.h"
#include "render/project/tile_key.h"
#include "render/project/tile_set.h"

namespace curvisplat {

/// The number of order tiles along a side of a painter's tile, and in all of it. They are counted row by row.
inline constexpr int kOrderTilesAlong = kTileSide / kOrderSide;
inline constexpr size_t kOrderTiles = size_t{kOrderTilesAlong} * kOrderTilesAlong;
/// Bit n: order tile n of a tile.
using OrderTileMask = uint64_t;
static_assert(kOrderTiles == 64);

/// The corner of a painter's tile with the smallest coordinates, in pixels.
struct TileCorner {
  float x, y;
};

/// The order tiles in which the centre of a pixel lies in the splat's ellipse, or within a hundredth of a
/// pixel of it.
OrderTileMask orderTilesOf(const TileCorner& tile, const ScreenSplat& splat);

/// Returns those of `tiles`, which the splat touches, in which its faces leave something of it.
OrderTileMask tilesLeftOf(const TileCorner& tile, const ScreenSplat& splat, const ScreenCut& cut,
                          OrderTileMask tiles);

/// The splats of an order tile, in the order in which they are to be painted. Each is an item of two fields,
/// from the top bit: the splat's key there (32 bits), its index in TileLists::order() (26).
using OrderList = std::span<const uint64_t>;

inline constexpr int kItemNumberBits = 26, kItemKeyBits = 32;
/// The index in TileLists::order() of an item of an OrderList.
inline uint32_t numberOf(uint64_t item) {
  return item & ((1u << kItemNumberBits) - 1);
}

/// The key of an item of an OrderList.
inline uint32_t keyOf(uint64_t item) {
  return static_cast<uint32_t>(item >> kItemNumberBits);
}

/// The lists of one tile at a time. Keeps its memory between calls: 8 bytes for each item of the largest
/// tile, and up to twice as much for items as they are added. One thread at a time.
class TileLists {
 public:
  TileLists();
  ~TileLists();

  /// Begins the lists of a tile, and forgets those of the tile before.
  void begin(const TileCorner& tile);
  /// Lists a splat in those of `tiles` where its key is at most `front`; returns the others, and raises its
  /// `first` to the least of its keys there. Splats with equal keys come in the order of the calls. `number`:
  /// the caller's number of the splat, which order() returns.
  OrderTileMask add(ScreenSplat& splat, uint32_t number, OrderTileMask tiles, uint32_t front);
  /// Sorts the lists. order() and lists() may be used from then until the next begin().
  void end();

  /// The numbers of the splats that are in at least one list, as add() got them and in that order.
  std::span<const uint32_t> order() const { return order_; }
  const std::array<OrderList, kOrderTiles>& lists() const { return lists_; }

 private:
  TileCorner tile_{};
  std::vector<uint32_t> order_;
  void distribute();
  void sort(std::span<uint64_t> list) const;

  struct Sorter;
  const std::unique_ptr<Sorter> sorter_;
  // The first staged_count_ are items in the order of the calls, below the numbers of their order tiles (6
  // bits); the others are space.
  std::vector<uint64_t> staged_;
  size_t staged_count_ = 0;
  std::unique_ptr<uint64_t[]> items_;  // of the lists, one behind the other
  size_t capacity_ = 0;                // of items_
  std::array<uint32_t, kOrderTiles> counts_{};
  std::array<OrderList, kOrderTiles> lists_;
};

}  // namespace curvisplat
