#include "render/gl/gl_context.h"

#include <sstream>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

std::string text(const GlFunctions& gl, GLenum name) {
  const auto* value = gl.GetString(name);
  return value ? reinterpret_cast<const char*>(value) : "unknown";
}

/// "4.5 (Core Profile) Mesa 22.3.6" -> "Mesa 22.3.6" and "4.5".
std::string describe(const std::string& library, const GlFunctions& gl) {
  std::istringstream words(text(gl, GL_VERSION));
  std::string version, word, driver;
  words >> version;
  while (words >> word) driver = word;
  return fmt::format("{} {}, {}, OpenGL {}", library, driver, text(gl, GL_RENDERER), version);
}

/// By the names that software renderers give themselves.
bool isSoftwareRenderer(const std::string& renderer) {
  for (const char* name : {"llvmpipe", "softpipe", "SWR", "SwiftShader", "Software"})
    if (renderer.find(name) != std::string::npos) return true;
  return false;
}

}  // namespace

GlContext::GlContext(const std::string& library, const GlFunctions::Lookup& lookup)
    : functions_(lookup),
      name_(describe(library, functions_)),
      software_(isSoftwareRenderer(text(functions_, GL_RENDERER))) {}

}  // namespace curvisplat
