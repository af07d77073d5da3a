#include "render/tiles/tile_lists.h"

#include <hwy/contrib/sort/vqsort.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "render/project/footprint.h"
#include "stream/base/vector_clones.h"

namespace curvisplat {
namespace {

constexpr int kRows = 8;
constexpr float kMargin = 0.01f;  // pixels, for rounding

/// An ellipse as its rows of pixels need it: at dy it covers lean dy ± span √(reach² - dy²).
struct EllipseRows {
  float x, y;  // the centre, from that of the tile's first pixel
  float lean, span, reach2;
};

/// Asks each of kRows rows of pixels, from `first` on, which columns of order tiles the ellipse touches in it: bit n, if it
/// has a pixel's centre in column n, or comes within a hundredth of a pixel of one.
CURVISPLAT_VECTOR_CLONES void findColumns(const EllipseRows& rows, float first, uint32_t (&out)[kRows]) {
  const auto [x, y, lean, span, reach2] = rows;
  for (int n = 0; n < kRows; ++n) {
    const float dy = first + static_cast<float>(n) - y;
    const float middle = x + lean * dy;
    const float half = span * std::sqrt(std::max(reach2 - dy * dy, 0.0f));
    // The numbers of the first column, and of the one behind the last.
    const float from = std::min(float{kTileSide}, std::max(0.0f, middle - half + (1 - kMargin)));
    const float end = std::min(float{kTileSide}, std::max(0.0f, middle + half + (1 + kMargin)));
    const auto column = static_cast<int32_t>(from), column_end = static_cast<int32_t>(end);
    const int32_t tile = column / kOrderSide, tile_end = (column_end + kOrderSide - 1) / kOrderSide;
    out[n] = column < column_end ? (1u << tile_end) - (1u << tile) : 0;
  }
}

}  // namespace

OrderTileMask orderTilesOf(const TileCorner& tile, const ScreenSplat& splat) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  const float s11 = splat.l21 * splat.l21 + splat.l22 * splat.l22, over = splat.l11 / s11;
  const EllipseRows rows{splat.x - (tile.x + 0.5f), splat.y - (tile.y + 0.5f), over * splat.l21,
                         over * splat.l22, kSupport * kSupport * s11};
  const float reach = std::sqrt(rows.reach2) + kMargin;
  const auto first = static_cast<int>(std::ceil(std::min(float{kTileSide}, std::max(0.0f, rows.y - reach))));
  const auto last = static_cast<int>(std::floor(std::min(kTileSide - 1.0f, std::max(-1.0f, rows.y + reach))));
  OrderTileMask tiles = 0;
  for (int begin = first; begin <= last; begin += kRows) {
    uint32_t columns[kRows];
    findColumns(rows, static_cast<float>(begin), columns);
    for (int n = 0; n < std::min(kRows, last + 1 - begin); ++n)
      tiles |= OrderTileMask{columns[n]} << (begin + n) / kOrderSide * kOrderTilesAlong;
  }
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
