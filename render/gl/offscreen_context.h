// An OpenGL context without a window, from whatever library the machine has.
#pragma once

#include <memory>

#include "render/gl/gl_context.h"

namespace curvisplat {

/// The libraries that give a context without a window.
enum class GlLibrary { kOsmesa, kEgl };

/// A core context of OpenGL 3.3 or newer, made current on the calling thread. Throws Error: what was tried,
/// and what it said.
std::unique_ptr<GlContext> makeOffscreenContext(GlLibrary library);

}  // namespace curvisplat
