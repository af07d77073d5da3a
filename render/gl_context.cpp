#include "render/gl_context.h"

#include <sstream>

#include "render/osmesa_context.h"
#include "stream/error.h"

namespace curvisplat {
namespace {

/// "4.5 (Core Profile) Mesa 22.3.6" -> "Mesa 22.3.6" and "4.5".
std::string describe(const std::string& library, const GlFunctions& gl) {
  const auto text = [&](GLenum name) {
    const auto* value = gl.GetString(name);
    return std::string(value ? reinterpret_cast<const char*>(value) : "unknown");
  };
  std::istringstream words(text(GL_VERSION));
  std::string version, word, driver;
  words >> version;
  while (words >> word) driver = word;
  return fmt::format("{} {}, {}, OpenGL {}", library, driver, text(GL_RENDERER), version);
}

}  // namespace

GlContext::GlContext(const std::string& library, const GlFunctions::Lookup& lookup)
    : functions_(lookup), name_(describe(library, functions_)) {}

std::unique_ptr<GlContext> makeOffscreenContext() {
  return makeOsMesaContext();
}

}  // namespace curvisplat
