#include "render/gl/card_buffer.h"

#include <algorithm>
#include <array>

#include "render/project/painter_failure.h"

namespace curvisplat {

namespace {

constexpr GLenum kFreeMemoryNvidia = 0x9049,
                 kFreeMemoryAti = 0x87FC;  // GL_NVX_gpu_memory_info, GL_ATI_meminfo

}  // namespace

uint64_t defaultCardBytes(const GlFunctions& gl, uint64_t available_bytes) {
  // A context that is lost may say so for ever.
  for (int n = 0; n < 100 && gl.GetError() != GL_NO_ERROR; ++n) {
  }
  std::array<GLint, 4> kibibytes{};
  for (const GLenum name : {kFreeMemoryNvidia, kFreeMemoryAti}) {
    gl.GetIntegerv(name, kibibytes.data());
    if (gl.GetError() == GL_NO_ERROR && kibibytes[0] > 0)
      return uint64_t{768} * static_cast<uint64_t>(kibibytes[0]);
  }
  constexpr uint64_t kUntold = uint64_t{768} << 20;
  return available_bytes > 0 ? std::min(kUntold, available_bytes / 8) : kUntold;
}

void CardBuffer::reserve(uint64_t bytes) {
  if (bytes <= bytes_) return;
  const uint64_t most = largest(gl_);
  if (bytes > most)
    throw PainterFailure(
        "this OpenGL has no buffers of {} MiB (at most {}); give --backend egl-quads, or cpu", bytes >> 20,
        most >> 20);
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
