// EGL: OpenGL on a graphics card without a display, and in software where there is none. The library is
// loaded at run time.
#pragma once

#include <memory>

#include "render/gl/gl_context.h"

namespace curvisplat {

/// Asks every device of the machine, graphics cards before software, then Mesa's surfaceless platform. Throws
/// Error: what each of them said.
std::unique_ptr<GlContext> makeEglContext();

/// Whether EGL knows of a device that is not software, or cannot tell. Much quicker than a context. Throws
/// Error where there is no EGL.
bool eglMayHaveCard();

}  // namespace curvisplat
