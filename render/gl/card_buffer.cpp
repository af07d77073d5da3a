#include "render/gl/card_buffer.h"

#include "stream/base/error.h"

namespace curvisplat {

void CardBuffer::reserve(uint64_t bytes) {
  if (bytes <= bytes_) return;
  const uint64_t most = largest(gl_);
  if (bytes > most)
    throw Error("this OpenGL has no buffers of {} MiB (at most {}); give --backend egl-quads, or cpu",
                bytes >> 20, most >> 20);
  bytes_ = 0;
  bind();
  gl_.BufferData(GL_SHADER_STORAGE_BUFFER, static_cast<GLsizeiptr>(bytes), nullptr, GL_DYNAMIC_COPY);
  gl_.check("splats and the lists of tiles");
  bytes_ = bytes;
}

void CardBuffer::release() {
  bind();
  gl_.BufferData(GL_SHADER_STORAGE_BUFFER, 0, nullptr, GL_DYNAMIC_COPY);
  bytes_ = 0;
}

uint64_t CardBuffer::largest(const GlFunctions& gl) {
  GLint64 most = 0;
  gl.GetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most);
  return static_cast<uint64_t>(most);
}

void CardBuffer::clear() const {
  bind();
  gl_.ClearBufferData(GL_SHADER_STORAGE_BUFFER, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
}

void CardBuffer::fill(uint64_t bytes, float value) const {
  bind();
  gl_.ClearBufferSubData(GL_SHADER_STORAGE_BUFFER, GL_R32F, 0, static_cast<GLsizeiptr>(bytes), GL_RED,
                         GL_FLOAT, &value);
  gl_.check("emptying a buffer of the card");
}

void CardBuffer::writeBytes(uint64_t offset, const void* bytes, uint64_t count) const {
  if (count == 0) return;
  bind();
  gl_.BufferSubData(GL_SHADER_STORAGE_BUFFER, static_cast<GLintptr>(offset), static_cast<GLsizeiptr>(count),
                    bytes);
  gl_.check("sending to the card");
}

}  // namespace curvisplat
