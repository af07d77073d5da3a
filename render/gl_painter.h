// Draws screen splats with OpenGL: an instanced quad a splat, the footprint and the classification as tables
// in textures, blended over what was drawn before in 32-bit floats.
//
// Colours are premultiplied. The image's top row is the framebuffer's first, so that nothing is ever flipped.
// Lives on the context's thread. Not built for: more than one frame at a time.
#pragma once

#include <glm/vec4.hpp>
#include <memory>
#include <span>

#include "render/classification.h"
#include "render/gl_context.h"
#include "render/image.h"
#include "render/projection.h"

namespace curvisplat {

class GlPainter {
 public:
  /// Compiles the programs. `context` outlives the painter. Throws Error.
  explicit GlPainter(const GlContext& context);
  ~GlPainter();

  /// Begins a frame filled with `background`. `per_pixel`: classify every pixel by the splat's slope and
  /// width, else one colour and extinction a splat. Throws Error where the image is larger than OpenGL's
  /// limit, which it names.
  void begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table, bool per_pixel);
  /// Blends `splats` over the frame in their order: farthest first. The span is free when the call returns.
  void draw(std::span<const ScreenSplat> splats);
  /// Waits for the drawing and reads the picture.
  Image end();

  /// Of the calling thread, since begin(). OpenGL may draw later than it is told to: end() waits for it, and
  /// counts as drawing.
  double uploadSeconds() const;
  double drawSeconds() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
