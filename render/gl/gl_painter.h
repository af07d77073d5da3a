// Draws screen splats with OpenGL: an instanced quad a splat, the footprint and the classification as tables
// in textures, blended over what was drawn before in 32-bit floats.
//
// The image's top row is the framebuffer's first, so that nothing is ever flipped.
// Lives on the context's thread. Not built for: more than one frame at a time.
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

  DrawingOrder order() const override { return DrawingOrder::kBackToFront; }
  void begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
             PixelShading shading, const PaintResources& resources = {}) override;
  void drawOnly(const TileSet& tiles) override;
  void draw(std::span<const ScreenSplat> splats) override;
  size_t drawsUnderWay() const override;
  void finishDraws() override;
  Image end() override;

  double uploadSeconds() const override;
  double drawSeconds() const override;
  double glSeconds() const override;

  /// An OpenGL buffer for `count` splats, persistently mapped; valid until the next call. Empty if OpenGL is
  /// older than 4.4.
  std::span<ScreenSplat> mapSplats(size_t count);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
