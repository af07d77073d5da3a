// The picture that tiles are painted into, on the card: an image for each window of depth, and how many pixels of each
// tile take no more.
//
// Lives on the context's thread, but for hides().
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "render/gl/card_buffer.h"
#include "render/gl/gl_functions.h"
#include "render/gl/gl_tile_lists.h"
#include "render/project/tile_set.h"

namespace curvisplat {

class TilePicture {
 public:
  explicit TilePicture(const GlFunctions& gl);

  /// Begins a picture of `windows` windows of depth. Nothing is painted yet, and all pixels are transparent. Throws
  /// Error if it is larger than OpenGL draws, and PainterFailure if there is no memory for it.
  void begin(ImageSize size, int windows);
  ImageSize size() const { return size_; }
  int windows() const { return window_count_; }
  /// The windows, a layer each: colours and transmittances.
  GLuint texture() const { return windows_.name(); }
  /// The picture's tiles, of kSmallTile or of kLargeTile.
  CardTiles tiles(bool small) const;
  /// Binds what splatTileShader() paints into, and sets its uniform of that.
  void bind(const GlProgram& painting) const;

  /// Finds which large tiles take no more, for hides(), by what was painted before: nothing has to be waited for.
  void lookAtClosed();
  /// Whether all tiles that the box touches take no more. Any thread.
  bool hides(const ScreenBox& box) const;

  /// Reads the windows, one after the other, and calls use() with them. Throws PainterFailure if the card was reset.
  void read(const std::function<void(std::span<const float>)>& use) const;
  uint64_t cardBytes() const { return 2 * window_bytes_ + closed_.bytes(); }

 private:
  void allocate(ImageSize size, int windows);
  size_t largeTiles() const { return TileSet::tilesOf(size_, kLargeTile); }

  const GlFunctions& gl_;
  GlObject windows_, framebuffer_, drawn_;  // drawn_: the windows, where the processor can read them
  CardBuffer closed_;  // pixels of each small tile, then of each large one, that take no more
  ImageSize size_{0, 0};
  int window_count_ = 0;
  uint64_t window_bytes_ = 0;
  std::unique_ptr<std::atomic<uint8_t>[]> hidden_;  // [large tile]
};

}  // namespace curvisplat
