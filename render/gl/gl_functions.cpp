#include "render/gl/gl_functions.h"

#include "stream/base/error.h"

namespace curvisplat {
namespace {

std::string_view errorName(GLenum error) {
  switch (error) {
    case GL_INVALID_ENUM:
      return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE:
      return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION:
      return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY:
      return "GL_OUT_OF_MEMORY";
    default:
      return "an unknown error";
  }
}

}  // namespace

GlFunctions::GlFunctions(const Lookup& lookup) {
#define CURVISPLAT_GL_FETCH(name, type)              \
  name = reinterpret_cast<type>(lookup("gl" #name)); \
  if (!name) throw Error("the OpenGL library has no function gl" #name "; OpenGL 3.3 or newer is needed");
  CURVISPLAT_GL_FUNCTIONS(CURVISPLAT_GL_FETCH)
#undef CURVISPLAT_GL_FETCH
#define CURVISPLAT_GL_FETCH(name, type) name = reinterpret_cast<type>(lookup("gl" #name));
  CURVISPLAT_GL_4_4_FUNCTIONS(CURVISPLAT_GL_FETCH)
#undef CURVISPLAT_GL_FETCH
}

bool GlFunctions::has44() const {
  GLint major = 0, minor = 0;
  GetIntegerv(GL_MAJOR_VERSION, &major);
  GetIntegerv(GL_MINOR_VERSION, &minor);
  if (major < 4 || (major == 4 && minor < 4)) return false;
#define CURVISPLAT_GL_HAS(name, type) \
  if (!name) return false;
  CURVISPLAT_GL_4_4_FUNCTIONS(CURVISPLAT_GL_HAS)
#undef CURVISPLAT_GL_HAS
  return true;
}

void GlFunctions::check(std::string_view doing) const {
  if (const GLenum error = GetError(); error != GL_NO_ERROR)
    throw Error("OpenGL failed while {}: {} (0x{:04x})", doing, errorName(error), error);
}

}  // namespace curvisplat
