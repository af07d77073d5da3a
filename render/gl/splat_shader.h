// The GLSL of a splat: what the fields of ScreenSplat mean, as code. The quads' shaders and the tiles' share it.
#pragma once

#include <string>

#include "render/project/tile_key.h"

namespace curvisplat {

struct SplatShaderKind {
  bool per_pixel;         // mean and extent of the scalar at every pixel, else the splat's mean for all of it
  bool log_scale;         // of the transfer function
  bool layered = false;   // layers lie in the picture
  bool coloured = false;  // splats have ScreenColours
  bool colour_log_scale = false;  // of the colours' scalar
  int windows = 1;      // of depth, between the layers of the pixels: each is drawn into an image of its own
  bool counts = false;  // splatTileShader() counts what pixels do (pixel_counts.h)

  bool operator<(const SplatShaderKind& other) const { return number() < other.number(); }

 private:
  int number() const {
    return 256 * counts + 32 * windows + 16 * coloured + 8 * colour_log_scale + 4 * layered + 2 * log_scale +
           per_pixel;
  }
};

/// Tiles that painters in compute shaders list splats for, in pixels along a side: where splats have an order of their own in
/// each order tile, and where they have one in all.
inline constexpr int kSmallTile = kOrderSide, kLargeTile = 16;

/// The binding of PixelCounts' counters.
inline constexpr int kPixelCountsBinding = 5;

/// The uniforms that SplatTables::use() sets.
std::string splatUniforms();
/// The two shaders that draw a splat as a quad; OpenGL 3.3.
std::string splatVertexShader();
std::string splatFragmentShader(SplatShaderKind kind);
/// Paints the pixels of tiles by their lists, front to back (gl_tile_painter.h); OpenGL 4.3.
std::string splatTileShader(SplatShaderKind kind);

}  // namespace curvisplat
