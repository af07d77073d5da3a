// A picture on its way to the window: an OpenGL texture of eight bits a channel.
#pragma once

#include <cstdint>
#include <span>

#include "render/gl/gl_functions.h"
#include "render/image/image.h"

namespace curvisplat {

/// Lives on the context's thread, no longer than the context. Shown pixel by pixel, or smoothly where it is
/// stretched.
class PictureTexture {
 public:
  explicit PictureTexture(const GlFunctions& gl);
  ~PictureTexture();
  PictureTexture(const PictureTexture&) = delete;
  PictureTexture& operator=(const PictureTexture&) = delete;

  /// Four bytes a pixel, red, green, blue, alpha, colours not multiplied; rows from the top.
  void set(std::span<const uint8_t> rgba, ImageSize size);

  bool isEmpty() const { return size_.width == 0; }
  ImageSize size() const { return size_; }
  /// For Dear ImGui.
  void* id() const { return reinterpret_cast<void*>(static_cast<uintptr_t>(texture_)); }

 private:
  const GlFunctions& gl_;
  GLuint texture_ = 0;
  ImageSize size_{0, 0};
};

}  // namespace curvisplat
