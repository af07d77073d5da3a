// The GLSL of a splat: what the fields of ScreenSplat mean, as code.
#pragma once

#include <string>

namespace curvisplat {

struct SplatShaderKind {
  bool per_pixel;         // mean and extent of the scalar at every pixel, else the splat's mean for all of it
  bool log_scale;         // of the transfer function
  bool layered = false;   // layers lie in the picture
  bool coloured = false;  // splats have ScreenColours
  bool colour_log_scale = false;  // of the colours' scalar
  int windows = 1;  // of depth, between the layers of the pixels: each is drawn into an attachment of its own
};

std::string splatVertexShader();
std::string splatFragmentShader(SplatShaderKind kind);

}  // namespace curvisplat
