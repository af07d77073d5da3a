// The OpenGL entry points that the program uses, fetched from the context's own getProcAddress. No GL library
// is linked: which one serves is decided when a context is made.
#pragma once

#include <GL/glcorearb.h>

#include <functional>
#include <string_view>

namespace curvisplat {

// name without its gl, and its type in glcorearb.h
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
  X(FramebufferRenderbuffer, PFNGLFRAMEBUFFERRENDERBUFFERPROC) \
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
  X(Uniform1f, PFNGLUNIFORM1FPROC)                             \
  X(Uniform1i, PFNGLUNIFORM1IPROC)                             \
  X(Uniform2f, PFNGLUNIFORM2FPROC)                             \
  X(Uniform4f, PFNGLUNIFORM4FPROC)                             \
  X(UseProgram, PFNGLUSEPROGRAMPROC)                           \
  X(VertexAttribDivisor, PFNGLVERTEXATTRIBDIVISORPROC)         \
  X(VertexAttribIPointer, PFNGLVERTEXATTRIBIPOINTERPROC)       \
  X(VertexAttribPointer, PFNGLVERTEXATTRIBPOINTERPROC)         \
  X(Viewport, PFNGLVIEWPORTPROC)

// Null, or refused, where the context is older: see has44().
#define CURVISPLAT_GL_4_4_FUNCTIONS(X)                                         \
  X(BufferStorage, PFNGLBUFFERSTORAGEPROC)                                     \
  X(DrawArraysInstancedBaseInstance, PFNGLDRAWARRAYSINSTANCEDBASEINSTANCEPROC) \
  X(MapBufferRange, PFNGLMAPBUFFERRANGEPROC)

/// Valid as long as the context is, on the thread where the context is current.
struct GlFunctions {
#define CURVISPLAT_GL_MEMBER(name, type) type name = nullptr;
  CURVISPLAT_GL_FUNCTIONS(CURVISPLAT_GL_MEMBER)
  CURVISPLAT_GL_4_4_FUNCTIONS(CURVISPLAT_GL_MEMBER)
#undef CURVISPLAT_GL_MEMBER

  using Lookup = std::function<void*(const char* name)>;
  /// Throws Error naming the first function that `lookup` does not know.
  explicit GlFunctions(const Lookup& lookup);

  /// Whether the functions of OpenGL 4.4 can be called. Some libraries have functions that their contexts
  /// refuse.
  bool has44() const;

  /// Throws Error if a call has failed since the last check: "OpenGL failed while <doing>: <error>".
  void check(std::string_view doing) const;
};

}  // namespace curvisplat
