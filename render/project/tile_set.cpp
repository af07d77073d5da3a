#include "render/project/tile_set.h"

#include "stream/base/error.h"

namespace curvisplat {

TileSet::TileSet(ImageSize size, const std::vector<uint32_t>& owners, uint32_t owner)
    : columns_(tilesAlong(size.width, kSharedTileSide)),
      rows_(tilesAlong(size.height, kSharedTileSide)),
      has_(owners.size()),
      sums_(static_cast<size_t>((columns_ + 1) * (rows_ + 1))) {
  CURVISPLAT_CHECK_OP(owners.size(), ==, tilesOf(size, kSharedTileSide));
  for (size_t tile = 0; tile < owners.size(); ++tile) has_[tile] = owners[tile] == owner;
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column)
      sums_[static_cast<size_t>((row + 1) * (columns_ + 1) + column + 1)] =
          has_[static_cast<size_t>(row * columns_ + column)] + before(column, row + 1) +
          before(column + 1, row) - before(column, row);
}

TileBox TileSet::box() const {
  TileBox box{columns_, rows_, 0, 0};
  for (int y = 0; y < rows_; ++y)
    for (int x = 0; x < columns_; ++x)
      if (has(static_cast<size_t>(y * columns_ + x)))
        box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x + 1), std::max(box.y1, y + 1)};
  return box.x0 < box.x1 ? box : TileBox{0, 0, 0, 0};
}

bool TileSet::hasAnyOf(size_t painters_tile) const {
  constexpr int kInTile = kTileSide / kSharedTileSide;
  const int tiles_along = (columns_ + kInTile - 1) / kInTile;
  const int x0 = static_cast<int>(painters_tile) % tiles_along * kInTile,
            y0 = static_cast<int>(painters_tile) / tiles_along * kInTile;
  const int x1 = std::min(x0 + kInTile, columns_), y1 = std::min(y0 + kInTile, rows_);
  return before(x1, y1) - before(x0, y1) - before(x1, y0) + before(x0, y0) > 0;
}

bool TileSet::touches(const ScreenBox& box) const {
  if (!(box.x0 <= box.x1 && box.y0 <= box.y1)) return true;  // no numbers: whatever draws it decides
  const int x0 = tileAt(box.x0 - kMargin, columns_), x1 = tileAt(box.x1 + kMargin, columns_) + 1;
  const int y0 = tileAt(box.y0 - kMargin, rows_), y1 = tileAt(box.y1 + kMargin, rows_) + 1;
  return before(x1, y1) - before(x0, y1) - before(x1, y0) + before(x0, y0) > 0;
}

}  // namespace curvisplat
