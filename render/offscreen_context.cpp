#include "render/offscreen_context.h"

#include "render/egl_context.h"
#include "render/osmesa_context.h"

namespace curvisplat {

std::unique_ptr<GlContext> makeOffscreenContext(GlLibrary library) {
  return library == GlLibrary::egl ? makeEglContext() : makeOsMesaContext();
}

}  // namespace curvisplat
