// Parts of a picture: rectangles in pixels, tiles, and sets of tiles: those that one of several processes
// draws, or those that are drawn at a time.
//
// Sets are of shared tiles, which are smaller than the painters' tiles, so that a few pixels with many
// splats can be divided; a painter's tile is a whole number of them. Whether a box touches a set is a
// question of four look-ups, in sums over the picture: 5 bytes a shared tile. Immutable; any thread.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/image/image.h"

namespace curvisplat {

/// A rectangle of the picture in pixels, with the coordinates of ScreenSplat::x and y.
struct ScreenBox {
  float x0, y0, x1, y1;
};

inline constexpr int kTileSide = 32;       // pixels: of painters
inline constexpr int kSharedTileSide = 8;  // of TileSet
static_assert(kTileSide % kSharedTileSide == 0);

inline constexpr uint32_t kNobody = UINT32_MAX;  // an owner of tiles

/// The shared tiles of columns x0 .. x1 - 1 in rows y0 .. y1 - 1.
struct TileBox {
  int x0, y0, x1, y1;
  int columns() const { return x1 - x0; }
  int rows() const { return y1 - y0; }
  size_t tiles() const { return static_cast<size_t>(columns()) * static_cast<size_t>(rows()); }
};

/// Some of a picture's shared tiles.
class TileSet {
 public:
  /// Boxes touch tiles that are this close, in pixels: between corners and centres, and rounding.
  static constexpr float kMargin = 1;

  /// `owners` [shared tile], in rows from the top: the set has those of `owner`.
  TileSet(ImageSize size, const std::vector<uint32_t>& owners, uint32_t owner);

  /// The number of tiles along a side, or in a picture: painters' tiles, unless `side` is given.
  static int tilesAlong(int pixels, int side = kTileSide) { return (pixels + side - 1) / side; }
  static size_t tilesOf(ImageSize size, int side = kTileSide) {
    return static_cast<size_t>(tilesAlong(size.width, side)) *
           static_cast<size_t>(tilesAlong(size.height, side));
  }
  /// The shared tile of a coordinate, of `tiles` along it; the outermost one of what lies outside.
  static int tileAt(float pixel, int tiles) {
    return static_cast<int>(std::clamp(pixel / kSharedTileSide, 0.0f, static_cast<float>(tiles - 1)));
  }

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  bool has(size_t tile) const { return has_[tile] != 0; }
  /// The smallest box around its tiles; without tiles if it has none.
  TileBox box() const;
  /// Whether the set has the pixel, which may lie outside of the picture.
  bool hasPixel(int x, int y) const {
    const int column = x / kSharedTileSide, row = y / kSharedTileSide;
    return column < columns_ && row < rows_ && has(static_cast<size_t>(row * columns_ + column));
  }
  /// Whether the set has any pixel of a painter's tile, by its number in rows.
  bool hasAnyOf(size_t painters_tile) const;
  /// Whether a rectangle lies in one of the tiles at least in part, or within a pixel of one.
  bool touches(const ScreenBox& box) const;

 private:
  uint32_t before(int column, int row) const {
    return sums_[static_cast<size_t>(row * (columns_ + 1) + column)];
  }

  int columns_, rows_;
  std::vector<uint8_t> has_;    // [tile]
  std::vector<uint32_t> sums_;  // [row][column]: tiles of the set above and to the left
};

}  // namespace curvisplat
