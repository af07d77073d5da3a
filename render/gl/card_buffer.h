// Memory on the card, for shaders.
#pragma once

#include <cstdint>
#include <span>

#include "render/gl/gl_functions.h"

namespace curvisplat {

/// Memory on the card that grows as it is needed; what was in it is lost then.
class CardBuffer {
 public:
  explicit CardBuffer(const GlFunctions& gl) : gl_(gl), object_(makeBuffer(gl)) {}

  /// Throws Error where the card has no such memory, or OpenGL no such buffers.
  void reserve(uint64_t bytes);
  /// Gives its memory up.
  void release();
  /// The largest that there can be.
  static uint64_t largest(const GlFunctions& gl);
  /// Binds the buffer for shaders, at the binding.
  void bind(GLuint binding) const { gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, object_.name()); }
  /// Binds the buffer for glBufferSubData and the like, at GL_SHADER_STORAGE_BUFFER.
  void bind() const { gl_.BindBuffer(GL_SHADER_STORAGE_BUFFER, object_.name()); }
  /// Sets it all to 0.
  void clear() const;
  /// Writes at the offset in bytes; the buffer has space for it.
  template <typename T>
  void write(uint64_t offset, std::span<const T> values) const {
    writeBytes(offset, values.data(), values.size_bytes());
  }

  uint64_t bytes() const { return bytes_; }

 private:
  void writeBytes(uint64_t offset, const void* bytes, uint64_t count) const;

  const GlFunctions& gl_;
  GlObject object_;
  uint64_t bytes_ = 0;
};

}  // namespace curvisplat
