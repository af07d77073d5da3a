// A buffer of the card's memory that shaders read and write. All calls are on the context's thread.
#pragma once

#include <cstdint>
#include <span>

#include "render/gl/gl_functions.h"

namespace curvisplat {

/// The card's memory that is taken for bricks unless told otherwise: three quarters of what is free there. Where the driver
/// does not tell, or knows of no memory of the card's own, as with cards that share the processor's: 768 MiB, but no more
/// than an eighth of the processor's `available_bytes` (0: unknown).
uint64_t defaultCardBytes(const GlFunctions& gl, uint64_t available_bytes);

/// A shader storage buffer that grows as needed. Growing loses its contents.
class CardBuffer {
 public:
  explicit CardBuffer(const GlFunctions& gl) : gl_(gl), object_(makeBuffer(gl)) {}

  /// Makes the buffer at least this large. Throws PainterFailure if the card lacks the memory, or OpenGL the kind of
  /// buffer.
  void reserve(uint64_t bytes);
  /// Frees the memory.
  void release();
  /// The largest buffer that OpenGL allows, in bytes.
  static uint64_t largest(const GlFunctions& gl);
  /// Binds the buffer at the shaders' binding point `binding`.
  void bind(GLuint binding) const { gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, object_.name()); }
  /// Binds the buffer for glBufferSubData and the like, at GL_SHADER_STORAGE_BUFFER.
  void bind() const { gl_.BindBuffer(GL_SHADER_STORAGE_BUFFER, object_.name()); }
  /// Fills the buffer with zeros.
  void clear() const;
  /// Fills the first bytes with this number.
  void fill(uint64_t bytes, float value) const;
  /// Writes the values from the offset in bytes on; they must fit into the buffer.
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
