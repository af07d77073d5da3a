// Pictures that stay on the card: textures of 8 bits a channel, which a window shows whose OpenGL shares them (GlSharing).
//
//   TilePicture, layers, background --a compute shader--> CardPicture --a fence--> the window's commands
//
// A picture has a texture of its own, so that none is drawn into while it is shown. Whoever needs it last, on whatever
// thread, leaves its texture to SharedBin, and the next context that gets to it deletes it.
#pragma once

#include <glm/vec4.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "render/gl/gl_functions.h"
#include "render/image/image.h"
#include "stream/base/mutex.h"

namespace curvisplat {

class SplatTables;
class TilePicture;

/// Textures and fences that nobody needs any more, of contexts that share them. Any thread.
class SharedBin {
 public:
  void put(GLuint texture, GLsync fence);
  /// Deletes them. A context that shares them is current on this thread.
  void empty(const GlFunctions& gl);

 private:
  struct Dead {
    GLuint texture;
    GLsync fence;
  };
  Mutex mutex_;
  std::vector<Dead> dead_ GUARDED_BY(mutex_);
};

/// A picture on the card. Rows count from the top, as an Image's. It interpolates linearly when it is stretched.
class CardPicture {
 public:
  /// Takes the texture, and later the fence after which it has been drawn.
  CardPicture(std::shared_ptr<SharedBin> bin, GLuint texture, ImageSize size)
      : bin_(std::move(bin)), texture_(texture), size_(size) {}
  void setDrawn(GLsync fence) { drawn_ = fence; }
  ~CardPicture() { bin_->put(texture_, drawn_); }
  CardPicture(const CardPicture&) = delete;
  CardPicture& operator=(const CardPicture&) = delete;

  /// Lets the commands that follow in the current context wait on the card until the picture is drawn. The texture has to
  /// be bound after that.
  void waitFor(const GlFunctions& gl) const;
  GLuint texture() const { return texture_; }
  ImageSize size() const { return size_; }
  uint64_t bytes() const { return 4 * size_.pixels(); }

 private:
  const std::shared_ptr<SharedBin> bin_;
  const GLuint texture_;
  const ImageSize size_;
  GLsync drawn_ = nullptr;
};

/// Makes them of what was painted. On the context's thread.
class CardPictures {
 public:
  /// A null `bin`: the context shares nothing.
  CardPictures(const GlFunctions& gl, std::shared_ptr<SharedBin> bin) : gl_(gl), bin_(std::move(bin)) {}

  bool canShare() const { return bin_ != nullptr; }
  /// The picture that SplatTables::composite() makes, in 8 bits. Throws PainterFailure where there is no memory for it.
  std::shared_ptr<CardPicture> make(const TilePicture& painted, const SplatTables& tables,
                                    const glm::vec4& background);

 private:
  const GlFunctions& gl_;
  const std::shared_ptr<SharedBin> bin_;
  std::optional<GlProgram> compositing_;  // compiled when it is first needed
};

}  // namespace curvisplat
