// A window's OpenGL without a window: an EGL context on a thread of its own, and others that share its textures.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "render/gl/card_picture.h"
#include "render/gl/gl_context.h"

namespace curvisplat {

class SharedEgl final : public GlSharing {
 public:
  /// Throws Error if there is no EGL.
  SharedEgl();

  const std::string& renderer() const override { return window_.renderer(); }
  std::unique_ptr<GlContext> makeContext() override;

  /// The bytes of a picture as the window reads them: four a pixel, rows from the top.
  std::vector<uint8_t> read(const CardPicture& picture);
  /// Whether the name is one of the window's textures.
  bool isTexture(GLuint name);

 private:
  GlThread window_{GlLibrary::kEgl};
  void* display_ = nullptr;
  void* context_ = nullptr;
  const std::shared_ptr<SharedBin> bin_ = std::make_shared<SharedBin>();
};

}  // namespace curvisplat
