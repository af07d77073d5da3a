// An OpenGL texture, 8 bits per channel, that shows a picture in the window.
#pragma once

#include <cstdint>
#include <span>
#include <utility>

#include "render/gl/gl_functions.h"
#include "render/image/image.h"

namespace curvisplat {

/// Use on the context's thread; destroy or release() before the context. Interpolates linearly when stretched.
class PictureTexture {
 public:
  explicit PictureTexture(const GlFunctions& gl);
  ~PictureTexture() { release(); }
  /// Deletes the texture. Then only the destructor may be called, on any thread.
  void release();
  PictureTexture(const PictureTexture&) = delete;
  PictureTexture& operator=(const PictureTexture&) = delete;

  /// Uploads a picture: red, green, blue, alpha per pixel, not premultiplied; rows from the top.
  void set(std::span<const uint8_t> rgba, ImageSize size);

  /// Both are of one context.
  void swap(PictureTexture& other) {
    std::swap(texture_, other.texture_);
    std::swap(size_, other.size_);
  }
  bool isEmpty() const { return size_.width == 0; }
  ImageSize size() const { return size_; }
  /// Texture identifier for Dear ImGui.
  void* id() const { return reinterpret_cast<void*>(static_cast<uintptr_t>(texture_)); }

 private:
  const GlFunctions& gl_;
  GLuint texture_ = 0;
  ImageSize size_{0, 0};
};

}  // namespace curvisplat
