// Draws screen splats with OpenGL 3.3. Each splat is an instanced quad, which is blended in 32-bit floats;
// tables of the footprint and the classification are textures.
//
// The image's top row is the framebuffer's first, so that nothing is ever flipped. Used on the context's
// thread, for one frame at a time.
#pragma once

#include <memory>

#include "render/gl/gl_context.h"
#include "render/project/painter.h"

namespace curvisplat {

class GlPainter final : public Painter {
 public:
  /// Compiles the programs. `context` outlives the painter. Throws Error.
  explicit GlPainter(const GlContext& context);
  ~GlPainter() override;

  void begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
             PixelShading shading, const PaintResources& resources = {}) override;
  void drawOnly(const TileSet& tiles) override;
  void draw(std::span<const ScreenSplat> splats) override;
  Image end() override;

  double uploadSeconds() const override;
  double drawSeconds() const override;
  CardWork cardWork() const override;
  bool isOverfull() const override;

  /// Bytes of memory that a frame takes besides the picture itself.
  static uint64_t bytes(ImageSize size, const PaintResources& resources);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
