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

/// The faces of a splat over order tiles, as linear functions of their columns and rows: where one is below zero, its face
/// leaves nothing.
struct FaceRows {
  float first[ScreenCut::kFaces], a_column[ScreenCut::kFaces], a_row[ScreenCut::kFaces];
};

CURVISPLAT_VECTOR_CLONES OrderTileMask findLeft(const FaceRows& faces, OrderTileMask tiles) {
  OrderTileMask left = 0;
  for (int row = 0; row < kOrderTilesAlong; ++row) {
    if ((tiles >> row * kOrderTilesAlong & 0xff) == 0) continue;
    const auto y = static_cast<float>(row);
    uint32_t columns = 0;
    for (int column = 0; column < kOrderTilesAlong; ++column) {
      const auto x = static_cast<float>(column);
      const float a = faces.first[0] + faces.a_column[0] * x + faces.a_row[0] * y;
      const float b = faces.first[1] + faces.a_column[1] * x + faces.a_row[1] * y;
      const float c = faces.first[2] + faces.a_column[2] * x + faces.a_row[2] * y;
      const bool nothing = (a < 0) | (b < 0) | (c < 0);
      columns |= static_cast<uint32_t>(!nothing) << column;
    }
    left |= OrderTileMask{columns} << row * kOrderTilesAlong;
  }
  return left & tiles;
}
static_assert(ScreenCut::kFaces == 3);

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

OrderTileMask tilesLeftOf(const TileCorner& tile, const ScreenSplat& splat, const ScreenCut& cut,
                          OrderTileMask tiles) {
  constexpr float kHalf = 0.5f * (kOrderSide - 1);     // from an order tile's middle to its outermost pixels
  constexpr float kSure = 1.001f * ScreenCut::kReach;  // for rounding
  const float inverse11 = 1 / splat.l11, inverse22 = 1 / splat.l22;
  const float dx = tile.x + 0.5f + kHalf - splat.x, dy = tile.y + 0.5f + kHalf - splat.y;
  FaceRows faces;
  bool all = true;
  for (size_t n = 0; n < ScreenCut::kFaces; ++n) {
    const auto& [at, by0, by1] = cut.faces[n];
    const float by_y = by1 * inverse22, by_x = (by0 - splat.l21 * by_y) * inverse11;
    const float most = at + kHalf * (std::abs(by_x) + std::abs(by_y)) + kSure;
    faces.first[n] = most + by_x * dx + by_y * dy;
    faces.a_column[n] = kOrderSide * by_x;
    faces.a_row[n] = kOrderSide * by_y;
    constexpr float kLast = kOrderTilesAlong - 1;
    const float least = std::min(0.0f, kLast * faces.a_column[n]) + std::min(0.0f, kLast * faces.a_row[n]);
    all = all && faces.first[n] + least >= 0;
  }
  return all ? tiles : findLeft(faces, tiles);
}

struct TileLists::Sorter {
  hwy::Sorter sort;
};

TileLists::TileLists() : sorter_(std::make_unique<Sorter>()) {}

TileLists::~TileLists() = default;

void TileLists::begin(const TileCorner& tile) {
  tile_ = tile;
  order_.clear();
  counts_.fill(0);
  staged_count_ = 0;
}

OrderTileMask TileLists::add(ScreenSplat& splat, uint32_t number, OrderTileMask tiles, uint32_t front) {
  constexpr float kHalf = 0.5f * kOrderSide;
  if (staged_.size() < staged_count_ + kOrderTiles) staged_.resize(2 * staged_.size() + kOrderTiles);
  const uint64_t index = order_.size();
  uint64_t* const begin = &staged_[staged_count_];
  uint64_t* end = begin;
  OrderTileMask behind = 0;
  uint32_t least = UINT32_MAX;  // of the keys behind the front
  for (; tiles != 0; tiles &= tiles - 1) {
    const auto tile = static_cast<uint32_t>(std::countr_zero(tiles));
    const uint32_t key =
        keyAt(splat, tile_.x + static_cast<float>(tile % kOrderTilesAlong * kOrderSide) + kHalf,
              tile_.y + static_cast<float>(tile / kOrderTilesAlong * kOrderSide) + kHalf);
    const bool is_behind = key > front;
    behind |= OrderTileMask{is_behind} << tile;
    least = std::min(least, is_behind ? key : UINT32_MAX);
    *end = (uint64_t{tile} << kItemKeyBits | key) << kItemNumberBits | index;
    end += !is_behind;
    counts_[tile] += !is_behind;
  }
  if (end != begin) order_.push_back(number);
  staged_count_ += static_cast<size_t>(end - begin);
  if (behind != 0) splat.first = least;
  return behind;
}

/// Moves the items from the order of the calls to their lists, one list behind the other.
void TileLists::distribute() {
  constexpr uint64_t kItem = (uint64_t{1} << (kItemKeyBits + kItemNumberBits)) - 1;
  if (staged_count_ > capacity_) {
    items_.reset();
    items_ = std::make_unique_for_overwrite<uint64_t[]>(staged_count_);
    capacity_ = staged_count_;
  }
  std::array<size_t, kOrderTiles> ends;
  size_t begin = 0;
  for (size_t tile = 0; tile < kOrderTiles; ++tile) {
    ends[tile] = begin;
    begin += counts_[tile];
  }
  for (size_t n = 0; n < staged_count_; ++n)
    items_[ends[staged_[n] >> (kItemKeyBits + kItemNumberBits)]++] = staged_[n] & kItem;
}

/// Splats come by the first key that they have in any tile: many lists are sorted, or nearly so.
void TileLists::sort(std::span<uint64_t> list) const {
  constexpr size_t kFew = 12, kShare = 16;  // items; those that may come before their neighbour
  size_t descents = 0;
  for (size_t n = 1; n < list.size(); ++n) descents += list[n] < list[n - 1];
  if (descents == 0) return;
  size_t moves = list.size() <= kFew ? kFew * kFew : descents * kShare <= list.size() ? list.size() : 0;
  for (size_t n = 1; n < list.size(); ++n) {
    if (moves == 0) return sorter_->sort(list.data(), list.size(), hwy::SortAscending());
    const uint64_t item = list[n];
    size_t place = n;
    for (; place > 0 && list[place - 1] > item; --place) list[place] = list[place - 1];
    list[place] = item;
    moves -= std::min(moves, n - place);
  }
}

void TileLists::end() {
  distribute();
  uint64_t* begin = items_.get();
  for (size_t tile = 0; tile < kOrderTiles; ++tile) {
    const std::span<uint64_t> list(begin, counts_[tile]);
    sort(list);
    lists_[tile] = list;
    begin += counts_[tile];
  }
}

}  // namespace curvisplat
