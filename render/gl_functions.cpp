#include "render/gl_functions.h"

#include "stream/error.h"

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
}

void GlFunctions::check(std::string_view doing) const {
  if (const GLenum error = GetError(); error != GL_NO_ERROR)
    throw Error("OpenGL failed while {}: {} (0x{:04x})", doing, errorName(error), error);
}

}  // namespace curvisplat
