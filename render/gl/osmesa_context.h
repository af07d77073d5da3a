// OSMesa: OpenGL in software, into memory, without a display or a GPU. The library is loaded at run time.
#pragma once

#include <memory>

#include "render/gl/gl_context.h"

namespace curvisplat {

/// Throws Error: the names tried and what the loader said, or that it gave no context.
std::unique_ptr<GlContext> makeOsMesaContext();

}  // namespace curvisplat
