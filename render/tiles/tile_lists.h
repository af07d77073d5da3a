// Lists for the order tiles of a tile: which of its splats touch each, in the order of their keys there (tile_key.h).
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

/// Order tiles along a painter's tile, and in it; row by row.
inline constexpr int kOrderTilesAlong = kTileSide / kOrderSide;
inline constexpr size_t kOrderTiles = size_t{kOrderTilesAlong} * kOrderTilesAlong;
/// Bit n: order tile n of a tile.
using OrderTileMask = uint64_t;
static_assert(kOrderTiles == 64);

/// A painter's tile, by the pixels of its corner.
struct TileCorner {
  float x, y;
};

/// The order tiles that have the centre of a pixel in the splat's ellipse, or within a hundredth of a pixel
/// of it.
OrderTileMask orderTilesOf(const TileCorner& tile, const ScreenSplat& splat);

/// The splats of an order tile, in the order in which they are to be painted. From the top bit: the order tile, 6 bits; the
/// key, 32; the number in TileLists::order(), 26.
using OrderList = std::span<const uint64_t>;

inline constexpr int kItemNumberBits = 26, kItemKeyBits = 32;
inline uint32_t numberOf(uint64_t item) {
  return item & ((1u << kItemNumberBits) - 1);
}

inline uint32_t keyOf(uint64_t item) {
  return static_cast<uint32_t>(item >> kItemNumberBits);
}

/// The lists of one tile at a time. Keeps its memory between calls. One thread at a time.
class TileLists {
 public:
  TileLists();
  ~TileLists();

  void begin(const TileCorner& tile);
  /// Lists a splat in those of `tiles` where its key lies up to `front`; returns the others. Splats with equal keys come
  /// in the order of the calls. `number`: what order() is to have.
  OrderTileMask add(const ScreenSplat& splat, uint32_t number, OrderTileMask tiles, uint32_t front);
  /// Sorts the lists.
  void end();

  /// The numbers of the splats that are in any list.
  std::span<const uint32_t> order() const { return order_; }
  const std::array<OrderList, kOrderTiles>& lists() const { return lists_; }

 private:
  TileCorner tile_{};
  std::vector<uint32_t> order_;
  struct Sorter;
  const std::unique_ptr<Sorter> sorter_;
  std::vector<uint64_t> items_;  // of the lists, the first item_count_; the others are space
  size_t item_count_ = 0;
  std::array<OrderList, kOrderTiles> lists_;
};

}  // namespace curvisplat
