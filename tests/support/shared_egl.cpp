#include "tests/support/shared_egl.h"

#define EGL_NO_X11
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>

#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

template <typename Function>
Function egl(const char* name) {
  static void* const library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
  return reinterpret_cast<Function>(dlsym(library, name));
}

void* lookUp(const char* name) {
  return reinterpret_cast<void*>(egl<PFNEGLGETPROCADDRESSPROC>("eglGetProcAddress")(name));
}

/// A context that is current while it lives.
struct Current {
  EGLDisplay display;
  EGLContext context;

  Current(EGLDisplay display_, EGLContext shared) : display(display_), context(EGL_NO_CONTEXT) {
    egl<PFNEGLBINDAPIPROC>("eglBindAPI")(EGL_OPENGL_API);
    // The window's own tells of resets, or does not: those that share have to do the same.
    for (const EGLint resets : {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY, EGL_NONE}) {
      const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                   4,
                                   EGL_CONTEXT_MINOR_VERSION,
                                   3,
                                   EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                   EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                   resets,
                                   EGL_LOSE_CONTEXT_ON_RESET,
                                   EGL_NONE};
      if (context == EGL_NO_CONTEXT)
        context =
            egl<PFNEGLCREATECONTEXTPROC>("eglCreateContext")(display, EGL_NO_CONFIG_KHR, shared, attributes);
    }
    if (context == EGL_NO_CONTEXT) throw Error("EGL makes no context that shares");
    egl<PFNEGLMAKECURRENTPROC>("eglMakeCurrent")(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context);
  }
  ~Current() {
    egl<PFNEGLMAKECURRENTPROC>("eglMakeCurrent")(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    egl<PFNEGLDESTROYCONTEXTPROC>("eglDestroyContext")(display, context);
  }
  Current(const Current&) = delete;
  Current& operator=(const Current&) = delete;
};

// The first base is current before the second one asks it for functions.
class SharingContext final : private Current, public GlContext {
 public:
  SharingContext(EGLDisplay display, EGLContext shared, std::shared_ptr<SharedBin> bin)
      : Current(display, shared), GlContext("shared EGL", lookUp, std::move(bin)) {}
};

}  // namespace

SharedEgl::SharedEgl() {
  window_.run([&](const GlContext&) {
    display_ = egl<PFNEGLGETCURRENTDISPLAYPROC>("eglGetCurrentDisplay")();
    context_ = egl<PFNEGLGETCURRENTCONTEXTPROC>("eglGetCurrentContext")();
  });
}

std::unique_ptr<GlContext> SharedEgl::makeContext() {
  return std::make_unique<SharingContext>(display_, context_, bin_);
}

std::vector<uint8_t> SharedEgl::read(const CardPicture& picture) {
  std::vector<uint8_t> bytes(4 * picture.size().pixels());
  window_.run([&](const GlContext& context) {
    const GlFunctions& gl = context.functions();
    picture.waitFor(gl);
    gl.BindTexture(GL_TEXTURE_2D, picture.texture());
    gl.GetTexImage(GL_TEXTURE_2D, 0, GL_RGBA, GL_UNSIGNED_BYTE, bytes.data());
    gl.BindTexture(GL_TEXTURE_2D, 0);
    gl.check("reading a shared texture");
  });
  return bytes;
}

bool SharedEgl::isTexture(GLuint name) {
  bool is_one = false;
  window_.run([&](const GlContext&) {
    is_one = reinterpret_cast<PFNGLISTEXTUREPROC>(lookUp("glIsTexture"))(name) == GL_TRUE;
  });
  return is_one;
}

}  // namespace curvisplat
