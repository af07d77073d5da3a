#include "render/tiles/tile_lists.h"

#include <hwy/contrib/sort/vqsort.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "render/project/footprint.h"
#include "stream/base/vector_clones.h"

namespace curvisplat {
namespace {

/// The pixels' centres in each row of order tiles that an ellipse covers, counted from the tile's first: from .. to.
struct RowExtents {
  float from[kOrderTilesAlong], to[kOrderTilesAlong];
};

/// `x`, `y`: the ellipse's centre, from the centre of the tile's first pixel.
CURVISPLAT_VECTOR_CLONES void findExtents(float x, float y, const ScreenSplat& splat, RowExtents& out) {
  // The ellipse covers lean dy ± span √(reach² - dy²) of the pixels at dy; it goes farthest right at dy = tip.
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const float s11 = splat.l21 * splat.l21 + splat.l22 * splat.l22, over = splat.l11 / s11;
  const float lean = over * splat.l21, span = over * splat.l22;
  const float reach2 = kSupport * kSupport * s11, tip = kSupport * splat.l21;
  for (int row = 0; row < kOrderTilesAlong; ++row) {
    const float top = static_cast<float>(row * kOrderSide) - y, bottom = top + (kOrderSide - 1);
    const float right = std::min(std::max(tip, top), bottom), left = std::min(std::max(-tip, top), bottom);
    out.to[row] = x + lean * right + span * std::sqrt(std::max(reach2 - right * right, 0.0f));
    out.from[row] = x + lean * left - span * std::sqrt(std::max(reach2 - left * left, 0.0f));
  }
}

struct OrderTileRange {
  int first, last;

  /// The order tiles along a tile with pixels' centres in from .. to, which count from the tile's first; none
  /// where first > last.
  static OrderTileRange of(float from, float to) {
    constexpr float kPerPixel = 1.0f / kOrderSide, kMargin = 0.01f;  // for rounding
    if (!(to >= -kMargin && from <= kTileSide - 1 + kMargin)) return {0, -1};
    return {static_cast<int>(std::max(from - kMargin, 0.0f) * kPerPixel),
            static_cast<int>(std::min((to + kMargin) * kPerPixel, kOrderTilesAlong - 1.0f))};
  }
};

}  // namespace

OrderTileMask orderTilesOf(const TileCorner& tile, const ScreenSplat& splat) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const float x = splat.x - (tile.x + 0.5f), y = splat.y - (tile.y + 0.5f);
  const float reach_x = kSupport * splat.l11;
  const float reach_y = kSupport * std::sqrt(splat.l21 * splat.l21 + splat.l22 * splat.l22);
  const auto rows = OrderTileRange::of(y - reach_y, y + reach_y);
  const auto columns = OrderTileRange::of(x - reach_x, x + reach_x);
  const auto maskOf = [](const OrderTileRange& range) -> OrderTileMask {
    return range.first > range.last ? 0 : (2u << range.last) - (1u << range.first);
  };
  OrderTileMask tiles = 0;
  if (rows.last - rows.first <= 1 || columns.first >= columns.last) {
    const OrderTileMask of_row = maskOf(columns);
    for (int row = rows.first; row <= rows.last; ++row) tiles |= of_row << row * kOrderTilesAlong;
    return tiles;
  }
  RowExtents extents;
  findExtents(x, y, splat, extents);
  for (int row = rows.first; row <= rows.last; ++row)
    tiles |= maskOf(OrderTileRange::of(extents.from[row], extents.to[row])) << row * kOrderTilesAlong;
  return tiles;
}

struct TileLists::Sorter {
  hwy::Sorter sort;
};

TileLists::TileLists() : sorter_(std::make_unique<Sorter>()) {}

TileLists::~TileLists() = default;

void TileLists::begin(const TileCorner& tile) {
  tile_ = tile;
  order_.clear();
  item_count_ = 0;
}

OrderTileMask TileLists::add(const ScreenSplat& splat, uint32_t number, OrderTileMask tiles, uint32_t front) {
  constexpr float kHalf = 0.5f * kOrderSide;
  if (items_.size() < item_count_ + kOrderTiles) items_.resize(2 * items_.size() + kOrderTiles);
  uint64_t* const begin = &items_[item_count_];
  uint64_t* end = begin;
  const uint64_t index = order_.size();
  OrderTileMask behind = 0;
  for (; tiles != 0; tiles &= tiles - 1) {
    const auto tile = static_cast<uint32_t>(std::countr_zero(tiles));
    const uint32_t key =
        keyAt(splat, tile_.x + static_cast<float>(tile % kOrderTilesAlong * kOrderSide) + kHalf,
              tile_.y + static_cast<float>(tile / kOrderTilesAlong * kOrderSide) + kHalf);
    const bool is_behind = key > front;
    behind |= OrderTileMask{is_behind} << tile;
    *end = (uint64_t{tile} << kItemKeyBits | key) << kItemNumberBits | index;
    end += !is_behind;
  }
  if (end != begin) order_.push_back(number);
  item_count_ += static_cast<size_t>(end - begin);
  return behind;
}

void TileLists::end() {
  if (item_count_ > 1) sorter_->sort(items_.data(), item_count_, hwy::SortAscending());
  size_t begin = 0;
  for (size_t tile = 0; tile < kOrderTiles; ++tile) {
    size_t end = begin;
    while (end < item_count_ && items_[end] >> (kItemKeyBits + kItemNumberBits) == tile) ++end;
    lists_[tile] = {items_.data() + begin, end - begin};
    begin = end;
  }
}

}  // namespace curvisplat
