#include "render/gl/tile_picture.h"

#include <algorithm>
#include <vector>

#include "render/gl/splat_shader.h"
#include "stream/base/error.h"

namespace curvisplat {

TilePicture::TilePicture(const GlFunctions& gl)
    : gl_(gl),
      windows_(makeTexture(gl)),
      framebuffer_(makeFramebuffer(gl)),
      drawn_(makeBuffer(gl)),
      closed_(gl) {}

void TilePicture::allocate(ImageSize size, int windows) {
  if (size == size_ && windows == window_count_) return;
  GLint most = 0;
  gl_.GetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
  if (size.width > most || size.height > most)
    throw Error(
        "an image of {}x{} pixels is larger than this OpenGL draws (at most {}x{}); ask for a smaller --size",
        size.width, size.height, most, most);
  size_ = {0, 0};
  windows_ = makeTexture(gl_);
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, windows_.name());
  gl_.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_RGBA32F, size.width, size.height, windows);
  closed_.reserve((TileSet::tilesOf(size, kSmallTile) + TileSet::tilesOf(size, kLargeTile)) *
                  sizeof(uint32_t));
  gl_.check("the picture");
  window_bytes_ = 4 * sizeof(float) * size.pixels() * static_cast<uint64_t>(windows);
  gl_.BindBuffer(GL_PIXEL_PACK_BUFFER, drawn_.name());
  gl_.BufferData(GL_PIXEL_PACK_BUFFER, static_cast<GLsizeiptr>(window_bytes_), nullptr, GL_STREAM_READ);
  gl_.BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
  gl_.check("the picture that is read");
  hidden_ = std::make_unique<std::atomic<uint8_t>[]>(TileSet::tilesOf(size, kLargeTile));
  size_ = size;
  window_count_ = windows;
}

void TilePicture::begin(ImageSize size, int windows) {
  allocate(size, windows);
  gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
  gl_.ClearColor(0, 0, 0, 1);
  for (int n = 0; n < window_count_; ++n) {
    gl_.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, windows_.name(), 0, n);
    gl_.Clear(GL_COLOR_BUFFER_BIT);
  }
  closed_.clear();
  gl_.check("beginning a frame");
  for (size_t tile = 0; tile < largeTiles(); ++tile) hidden_[tile].store(0, std::memory_order_relaxed);
}

CardTiles TilePicture::tiles(bool small) const {
  const auto small_tiles = static_cast<uint32_t>(TileSet::tilesOf(size_, kSmallTile));
  return {small ? kSmallTile : kLargeTile, size_, &closed_, small ? 0 : small_tiles};
}

void TilePicture::bind(const GlProgram& painting) const {
  const CardTiles small = tiles(true), large = tiles(false);
  gl_.Uniform3i(painting.uniform("closed_places"), small.columns(), large.columns(),
                static_cast<GLint>(large.closed_begin));
  closed_.bind(3);
  gl_.BindImageTexture(0, windows_.name(), 0, GL_TRUE, 0, GL_READ_WRITE, GL_RGBA32F);
}

void TilePicture::lookAtClosed() {
  std::vector<uint32_t> pixels(largeTiles());
  closed_.bind();
  gl_.GetBufferSubData(GL_SHADER_STORAGE_BUFFER,
                       static_cast<GLintptr>(tiles(false).closed_begin * sizeof(uint32_t)),
                       static_cast<GLsizeiptr>(std::span(pixels).size_bytes()), pixels.data());
  const int columns = TileSet::tilesAlong(size_.width, kLargeTile);
  for (size_t tile = 0; tile < pixels.size(); ++tile) {
    const int x = static_cast<int>(tile) % columns * kLargeTile,
              y = static_cast<int>(tile) / columns * kLargeTile;
    const int all = std::min(kLargeTile, size_.width - x) * std::min(kLargeTile, size_.height - y);
    hidden_[tile].store(pixels[tile] == static_cast<uint32_t>(all), std::memory_order_relaxed);
  }
}

bool TilePicture::hides(const ScreenBox& box) const {
  if (!(box.x0 <= box.x1 && box.y0 <= box.y1)) return false;
  const auto at = [](float pixel, int pixels) {
    return static_cast<int>(std::clamp(pixel, 0.0f, static_cast<float>(pixels - 1))) / kLargeTile;
  };
  const int columns = TileSet::tilesAlong(size_.width, kLargeTile);
  for (int row = at(box.y0, size_.height); row <= at(box.y1, size_.height); ++row)
    for (int column = at(box.x0, size_.width); column <= at(box.x1, size_.width); ++column)
      if (!hidden_[static_cast<size_t>(row * columns + column)].load(std::memory_order_relaxed)) return false;
  return true;
}

/// The windows go through a buffer that the card itself writes, since drivers copy into other memory much slower.
void TilePicture::read(const std::function<void(std::span<const float>)>& use) const {
  gl_.BindBuffer(GL_PIXEL_PACK_BUFFER, drawn_.name());
  struct Release {  // where there is no memory for the picture, too
    const GlFunctions& gl;
    bool is_mapped = false;
    ~Release() {
      if (is_mapped) gl.UnmapBuffer(GL_PIXEL_PACK_BUFFER);
      gl.BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    }
  } release{gl_};
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, windows_.name());
  gl_.GetTexImage(GL_TEXTURE_2D_ARRAY, 0, GL_RGBA, GL_FLOAT, nullptr);
  const void* const mapped =
      gl_.MapBufferRange(GL_PIXEL_PACK_BUFFER, 0, static_cast<GLsizeiptr>(window_bytes_), GL_MAP_READ_BIT);
  gl_.check("reading the picture");
  release.is_mapped = true;
  gl_.checkReset("drawing");
  use({static_cast<const float*>(mapped), window_bytes_ / sizeof(float)});
}

}  // namespace curvisplat
