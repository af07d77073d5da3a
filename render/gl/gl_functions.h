// OpenGL as C++: the entry points that the program uses, fetched from the context's own getProcAddress, and
// objects that own OpenGL's names (buffers, textures, programs, fences).
//
// No GL library is linked: the context decides which one is used. Functions are valid as long as the context.
// Objects are move-only, and delete their name when they are destroyed. Everything is called, made and
// destroyed on the context's thread.
#pragma once

#include <GL/glcorearb.h>

#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace curvisplat {

// Each function: its name without gl, and its type in glcorearb.h.
#define CURVISPLAT_GL_FUNCTIONS(X)                             \
  X(ActiveTexture, PFNGLACTIVETEXTUREPROC)                     \
  X(AttachShader, PFNGLATTACHSHADERPROC)                       \
  X(BeginQuery, PFNGLBEGINQUERYPROC)                           \
  X(BindBuffer, PFNGLBINDBUFFERPROC)                           \
  X(BindFramebuffer, PFNGLBINDFRAMEBUFFERPROC)                 \
  X(BindRenderbuffer, PFNGLBINDRENDERBUFFERPROC)               \
  X(BindTexture, PFNGLBINDTEXTUREPROC)                         \
  X(BindVertexArray, PFNGLBINDVERTEXARRAYPROC)                 \
  X(BlendFunc, PFNGLBLENDFUNCPROC)                             \
  X(BufferData, PFNGLBUFFERDATAPROC)                           \
  X(BufferSubData, PFNGLBUFFERSUBDATAPROC)                     \
  X(CheckFramebufferStatus, PFNGLCHECKFRAMEBUFFERSTATUSPROC)   \
  X(Clear, PFNGLCLEARPROC)                                     \
  X(ClearColor, PFNGLCLEARCOLORPROC)                           \
  X(ClientWaitSync, PFNGLCLIENTWAITSYNCPROC)                   \
  X(CompileShader, PFNGLCOMPILESHADERPROC)                     \
  X(CreateProgram, PFNGLCREATEPROGRAMPROC)                     \
  X(CreateShader, PFNGLCREATESHADERPROC)                       \
  X(DeleteBuffers, PFNGLDELETEBUFFERSPROC)                     \
  X(DeleteFramebuffers, PFNGLDELETEFRAMEBUFFERSPROC)           \
  X(DeleteProgram, PFNGLDELETEPROGRAMPROC)                     \
  X(DeleteQueries, PFNGLDELETEQUERIESPROC)                     \
  X(DeleteRenderbuffers, PFNGLDELETERENDERBUFFERSPROC)         \
  X(DeleteShader, PFNGLDELETESHADERPROC)                       \
  X(DeleteSync, PFNGLDELETESYNCPROC)                           \
  X(DeleteTextures, PFNGLDELETETEXTURESPROC)                   \
  X(DeleteVertexArrays, PFNGLDELETEVERTEXARRAYSPROC)           \
  X(DrawArraysInstanced, PFNGLDRAWARRAYSINSTANCEDPROC)         \
  X(DrawBuffers, PFNGLDRAWBUFFERSPROC)                         \
  X(Enable, PFNGLENABLEPROC)                                   \
  X(EnableVertexAttribArray, PFNGLENABLEVERTEXATTRIBARRAYPROC) \
  X(EndQuery, PFNGLENDQUERYPROC)                               \
  X(FenceSync, PFNGLFENCESYNCPROC)                             \
  X(Flush, PFNGLFLUSHPROC)                                     \
  X(FramebufferRenderbuffer, PFNGLFRAMEBUFFERRENDERBUFFERPROC) \
  X(FramebufferTextureLayer, PFNGLFRAMEBUFFERTEXTURELAYERPROC) \
  X(GenBuffers, PFNGLGENBUFFERSPROC)                           \
  X(GenFramebuffers, PFNGLGENFRAMEBUFFERSPROC)                 \
  X(GenQueries, PFNGLGENQUERIESPROC)                           \
  X(GenRenderbuffers, PFNGLGENRENDERBUFFERSPROC)               \
  X(GenTextures, PFNGLGENTEXTURESPROC)                         \
  X(GenVertexArrays, PFNGLGENVERTEXARRAYSPROC)                 \
  X(GetError, PFNGLGETERRORPROC)                               \
  X(GetIntegerv, PFNGLGETINTEGERVPROC)                         \
  X(GetProgramInfoLog, PFNGLGETPROGRAMINFOLOGPROC)             \
  X(GetProgramiv, PFNGLGETPROGRAMIVPROC)                       \
  X(GetQueryObjectui64v, PFNGLGETQUERYOBJECTUI64VPROC)         \
  X(GetShaderInfoLog, PFNGLGETSHADERINFOLOGPROC)               \
  X(GetShaderiv, PFNGLGETSHADERIVPROC)                         \
  X(GetString, PFNGLGETSTRINGPROC)                             \
  X(GetUniformLocation, PFNGLGETUNIFORMLOCATIONPROC)           \
  X(LinkProgram, PFNGLLINKPROGRAMPROC)                         \
  X(ReadBuffer, PFNGLREADBUFFERPROC)                           \
  X(ReadPixels, PFNGLREADPIXELSPROC)                           \
  X(RenderbufferStorage, PFNGLRENDERBUFFERSTORAGEPROC)         \
  X(Scissor, PFNGLSCISSORPROC)                                 \
  X(ShaderSource, PFNGLSHADERSOURCEPROC)                       \
  X(TexBuffer, PFNGLTEXBUFFERPROC)                             \
  X(TexImage2D, PFNGLTEXIMAGE2DPROC)                           \
  X(TexParameteri, PFNGLTEXPARAMETERIPROC)                     \
  X(TexSubImage3D, PFNGLTEXSUBIMAGE3DPROC)                     \
  X(Uniform1f, PFNGLUNIFORM1FPROC)                             \
  X(Uniform1i, PFNGLUNIFORM1IPROC)                             \
  X(Uniform2f, PFNGLUNIFORM2FPROC)                             \
  X(Uniform4f, PFNGLUNIFORM4FPROC)                             \
  X(UseProgram, PFNGLUSEPROGRAMPROC)                           \
  X(VertexAttribDivisor, PFNGLVERTEXATTRIBDIVISORPROC)         \
  X(VertexAttribIPointer, PFNGLVERTEXATTRIBIPOINTERPROC)       \
  X(VertexAttribPointer, PFNGLVERTEXATTRIBPOINTERPROC)         \
  X(Viewport, PFNGLVIEWPORTPROC)                               \
  X(WaitSync, PFNGLWAITSYNCPROC)

// These are null, or fail, if the context is older than 4.3: see whyNoCompute().
#define CURVISPLAT_GL_4_3_FUNCTIONS(X)               \
  X(BindBufferBase, PFNGLBINDBUFFERBASEPROC)         \
  X(BindImageTexture, PFNGLBINDIMAGETEXTUREPROC)     \
  X(ClearBufferData, PFNGLCLEARBUFFERDATAPROC)       \
  X(ClearBufferSubData, PFNGLCLEARBUFFERSUBDATAPROC) \
  X(DispatchCompute, PFNGLDISPATCHCOMPUTEPROC)       \
  X(GetBufferSubData, PFNGLGETBUFFERSUBDATAPROC)     \
  X(GetInteger64v, PFNGLGETINTEGER64VPROC)           \
  X(GetTexImage, PFNGLGETTEXIMAGEPROC)               \
  X(MapBufferRange, PFNGLMAPBUFFERRANGEPROC)         \
  X(MemoryBarrier, PFNGLMEMORYBARRIERPROC)           \
  X(TexStorage2D, PFNGLTEXSTORAGE2DPROC)             \
  X(TexStorage3D, PFNGLTEXSTORAGE3DPROC)             \
  X(Uniform1ui, PFNGLUNIFORM1UIPROC)                 \
  X(Uniform2i, PFNGLUNIFORM2IPROC)                   \
  X(Uniform3i, PFNGLUNIFORM3IPROC)                   \
  X(Uniform4i, PFNGLUNIFORM4IPROC)                   \
  X(UnmapBuffer, PFNGLUNMAPBUFFERPROC)

struct GlFunctions {
#define CURVISPLAT_GL_MEMBER(name, type) type name = nullptr;
  CURVISPLAT_GL_FUNCTIONS(CURVISPLAT_GL_MEMBER)
  CURVISPLAT_GL_4_3_FUNCTIONS(CURVISPLAT_GL_MEMBER)
#undef CURVISPLAT_GL_MEMBER

  /// Null before OpenGL 4.5.
  PFNGLGETGRAPHICSRESETSTATUSPROC GetGraphicsResetStatus = nullptr;

  using Lookup = std::function<void*(const char* name)>;
  /// Throws Error naming the first function that `lookup` does not know.
  explicit GlFunctions(const Lookup& lookup);

  /// Says why compute shaders cannot be used; empty if they can. Some libraries have functions that their
  /// contexts refuse.
  std::string whyNoCompute() const;

  /// Throws PainterFailure if a call has failed since the last check: "OpenGL failed while <doing>: <error>"; where memory
  /// ran out, CardMemoryFailure.
  void check(std::string_view doing) const;
  /// Throws PainterFailure if the card was reset, so that what was drawn is lost. Only a context that was created to notify
  /// of resets knows.
  void checkReset(std::string_view doing) const;

 private:
  bool isAtLeast(int major, int minor) const;
};

/// Owns a name that glGen...(1, &name) made, and passes it to glDelete...(1, &name) at the end.
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

/// A linked program: of a vertex and a fragment shader, or of a compute shader.
class GlProgram {
 public:
  /// Throws Error with the first line of the compiler's or the linker's message.
  GlProgram(const GlFunctions& gl, std::string_view vertex_source, std::string_view fragment_source);
  GlProgram(const GlFunctions& gl, std::string_view compute_source);
  ~GlProgram();
  GlProgram(GlProgram&& other) noexcept : gl_(other.gl_), name_(std::exchange(other.name_, 0)) {}
  GlProgram& operator=(GlProgram&&) = delete;

  GLuint name() const { return name_; }
  /// The location of a uniform of the program; -1, which GL ignores, if it was optimised away.
  GLint uniform(const char* name) const { return gl_->GetUniformLocation(name_, name); }

 private:
  void link();

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

  /// Waits until all commands before it are done.
  void wait() const;

 private:
  const GlFunctions* gl_;
  GLsync sync_;
};

/// Measures how long OpenGL works, by its own clock, in sums for a few kinds of work.
class GlTimers {
 public:
  GlTimers(const GlFunctions& gl, size_t kinds) : gl_(gl), seconds_(kinds) {}

  /// Calls run() and measures its commands as work of this kind. run() must not call measure().
  template <typename Run>
  void measure(size_t kind, const Run& run) {
    running_.push_back({kind, makeQuery(gl_)});
    gl_.BeginQuery(GL_TIME_ELAPSED, running_.back().query.name());
    const struct End {  // where run() throws, too
      const GlFunctions& gl;
      ~End() { gl.EndQuery(GL_TIME_ELAPSED); }
    } end{gl_};
    run();
  }
  /// Waits until OpenGL has done all measured work.
  void finish();
  void reset();
  /// Seconds of this kind of work between reset() and the last finish().
  double seconds(size_t kind) const { return seconds_[kind]; }

 private:
  struct Running {
    size_t kind;
    GlObject query;
  };
  const GlFunctions& gl_;
  std::vector<double> seconds_;
  std::vector<Running> running_;
};

}  // namespace curvisplat
