// The GLSL of the projecting shader (project_shader.h) that draws splats, whole or in pieces: how faces of borders and clip planes
// cut them, the layers of their pixels, the scalar of the colours, and the records of all that. It does what projectRange() and
// choosePieces() in projection.cpp, plane_cuts.cpp and splat_chooser.h do.
#pragma once

#include <string>

namespace curvisplat {

/// The buffers and uniforms that it reads.
std::string pieceInputs();
/// The functions, main() among them. They follow those of project_shader.cpp.
std::string pieceFunctions();

}  // namespace curvisplat
