#include "render/gl/offscreen_context.h"

#include "render/gl/egl_context.h"
#include "render/gl/osmesa_context.h"

namespace curvisplat {

std::unique_ptr<GlContext> makeOffscreenContext(GlLibrary library) {
  return library == GlLibrary::kEgl ? makeEglContext() : makeOsMesaContext();
}

}  // namespace curvisplat
