// The windows of depth between the layers of a picture (render/project/pixel_layers.h), tile by tile, for those
// tiles in which layers lie.
//
//   window 0        the tile itself, as that of a picture without layers
//   windows 1, ...  further tiles of the same form, each accumulated on its own
//
// A window that a pixel does not have, since it lies behind an opaque layer, lets nothing through from the
// beginning. A block takes no more in a window behind which nothing is seen, and nothing in those behind it.
//
// Memory is taken where layers are: 4 bytes a pixel and layer, 16 a pixel and window from the second on.
#pragma once

#include <hwy/aligned_allocator.h>

#include <array>
#include <cstdint>
#include <vector>

#include "render/cpu/tile.h"
#include "render/project/pixel_layers.h"
#include "render/tiles/splat_bins.h"

namespace curvisplat {

class WindowTiles {
 public:
  /// Begins a frame with layers of the picture's size, which outlive it; null: without.
  void begin(const PixelLayers* layers, PaintLoop& loop);
  static uint64_t bytes(const PixelLayers& layers);

  /// Null where the tile has no layers. One thread at a time for each tile.
  TileWindows* tile(size_t number) {
    return offsets_.empty() || offsets_[number] == kNone ? nullptr : &tiles_[offsets_[number]];
  }
  const TileWindows* tile(size_t number) const { return const_cast<WindowTiles*>(this)->tile(number); }

 private:
  static constexpr uint32_t kNone = ~uint32_t{0};
  struct Needs {
    int layers = 0, windows = 1;
    size_t floats() const {
      return layers == 0 ? 0
                         : static_cast<size_t>(layers) * kTileSide * kTileSide +
                               static_cast<size_t>(windows - 1) * kTileFloats;
    }
  };
  static std::vector<Needs> needsOf(const PixelLayers& layers);
  static void fill(const PixelLayers& layers, size_t number, const Needs& needs, float* at,
                   TileWindows& tile);

  std::vector<uint32_t> offsets_;  // [tile], into tiles_
  std::vector<TileWindows> tiles_;
  hwy::AlignedFreeUniquePtr<float[]> floats_;
  size_t capacity_ = 0;
};

}  // namespace curvisplat
