// OpenGL's names as values that own what they name. Move-only; made and destroyed on the context's thread.
#pragma once

#include <string_view>
#include <utility>

#include "render/gl/gl_functions.h"

namespace curvisplat {

/// A name from glGen...(1, &name), given back to glDelete...(1, &name).
class GlObject {
 public:
  using Generate = void(APIENTRYP)(GLsizei, GLuint*);
  using Delete = void(APIENTRYP)(GLsizei, const GLuint*);

  GlObject(Generate generate, Delete remove) : delete_(remove) { generate(1, &name_); }
  ~GlObject() {
    if (name_) delete_(1, &name_);
  }
  GlObject(GlObject&& other) noexcept : delete_(other.delete_), name_(std::exchange(other.name_, 0)) {}
  GlObject& operator=(GlObject&& other) noexcept {
    std::swap(delete_, other.delete_);
    std::swap(name_, other.name_);
    return *this;
  }

  GLuint name() const { return name_; }

 private:
  Delete delete_;
  GLuint name_ = 0;
};

inline GlObject makeBuffer(const GlFunctions& gl) {
  return {gl.GenBuffers, gl.DeleteBuffers};
}
inline GlObject makeTexture(const GlFunctions& gl) {
  return {gl.GenTextures, gl.DeleteTextures};
}
inline GlObject makeVertexArray(const GlFunctions& gl) {
  return {gl.GenVertexArrays, gl.DeleteVertexArrays};
}
inline GlObject makeFramebuffer(const GlFunctions& gl) {
  return {gl.GenFramebuffers, gl.DeleteFramebuffers};
}
inline GlObject makeRenderbuffer(const GlFunctions& gl) {
  return {gl.GenRenderbuffers, gl.DeleteRenderbuffers};
}

inline GlObject makeQuery(const GlFunctions& gl) {
  return {gl.GenQueries, gl.DeleteQueries};
}

/// A linked program of a vertex and a fragment shader.
class GlProgram {
 public:
  /// Throws Error with the compiler's or the linker's words.
  GlProgram(const GlFunctions& gl, std::string_view vertex_source, std::string_view fragment_source);
  ~GlProgram();
  GlProgram(GlProgram&& other) noexcept : gl_(other.gl_), name_(std::exchange(other.name_, 0)) {}
  GlProgram& operator=(GlProgram&&) = delete;

  GLuint name() const { return name_; }
  /// Of a uniform that the program has; -1, which GL ignores, of one that was optimised away.
  GLint uniform(const char* name) const { return gl_->GetUniformLocation(name_, name); }

 private:
  const GlFunctions* gl_;
  GLuint name_ = 0;
};

/// A point in the stream of commands that can be waited for.
class GlFence {
 public:
  explicit GlFence(const GlFunctions& gl) : gl_(&gl), sync_(gl.FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)) {}
  ~GlFence() {
    if (sync_) gl_->DeleteSync(sync_);
  }
  GlFence(GlFence&& other) noexcept : gl_(other.gl_), sync_(std::exchange(other.sync_, nullptr)) {}
  GlFence& operator=(GlFence&&) = delete;

  /// Until all before it is done.
  void wait() const;

 private:
  const GlFunctions* gl_;
  GLsync sync_;
};

}  // namespace curvisplat
