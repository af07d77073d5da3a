#include "tools/viewer/picture_texture.h"

#include "stream/base/check.h"

namespace curvisplat {

PictureTexture::PictureTexture(const GlFunctions& gl) : gl_(gl) {
  gl_.GenTextures(1, &texture_);
  gl_.BindTexture(GL_TEXTURE_2D, texture_);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
}

void PictureTexture::release() {
  if (texture_ != 0) gl_.DeleteTextures(1, &texture_);
  texture_ = 0;
  size_ = {0, 0};
}

void PictureTexture::set(std::span<const uint8_t> rgba, ImageSize size) {
  CURVISPLAT_CHECK_OP(rgba.size(), ==, 4 * size.pixels());
  gl_.BindTexture(GL_TEXTURE_2D, texture_);
  gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, size.width, size.height, 0, GL_RGBA, GL_UNSIGNED_BYTE,
                 rgba.data());
  gl_.check("showing a picture");
  size_ = size;
}

}  // namespace curvisplat
