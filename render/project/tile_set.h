// Some of a picture's tiles: those that one of several processes draws, or that are drawn at a time. A tile is a square of
// kTileSide pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/image/image_size.h"
#include "render/project/screen_box.h"

namespace curvisplat {

inline constexpr int kTileSide = 32;  // pixels

/// The tiles of columns x0 .. x1 - 1 in rows y0 .. y1 - 1.
struct TileBox {
  int x0, y0, x1, y1;
  int columns() const { return x1 - x0; }
  int rows() const { return y1 - y0; }
  size_t tiles() const { return static_cast<size_t>(columns()) * static_cast<size_t>(rows()); }
};

/// Immutable; any thread.
class TileSet {
 public:
  /// `owners` [tile], in rows from the top: the set has those of `owner`.
  TileSet(ImageSize size, const std::vector<uint32_t>& owners, uint32_t owner);

  static int tilesAlong(int pixels) { return (pixels + kTileSide - 1) / kTileSide; }
  static size_t tilesOf(ImageSize size) {
    return static_cast<size_t>(tilesAlong(size.width)) * static_cast<size_t>(tilesAlong(size.height));
  }

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  bool has(size_t tile) const { return has_[tile] != 0; }
  /// The smallest box around its tiles; without tiles if it has none.
  TileBox box() const;
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
