// What draws screen splats, whatever with: OpenGL or the processor.
//
//   begin -> draw, draw, ... (in the painter's order) -> end
//
// Colours are premultiplied. One frame at a time, on the thread that the painter's backend says.
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <span>

#include "render/colour/classification.h"
#include "render/image/image.h"
#include "render/project/screen_splat.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// What a painter may take for a frame. OpenGL takes what its driver takes.
struct PaintResources {
  unsigned threads = 0;         // 0: one a core
  size_t batch_splats = 65536;  // that may be kept back, to be drawn together
};

/// How the pixels of a splat get their colours.
struct PixelShading {
  bool per_pixel = true;  // by the splat's slope and width at each; else one colour and extinction a splat
  bool lit = false;       // splats carry light (light.h)
};

/// In pixels, as ScreenSplat::x and y.
struct ScreenBox {
  float x0, y0, x1, y1;
};

class Painter {
 public:
  virtual ~Painter() = default;

  /// In which splats are to be drawn.
  virtual DrawingOrder order() const = 0;

  /// Begins a frame filled with `background`. `table` outlives the frame. Throws Error where the image is larger
  /// than the painter's limit, which it names.
  virtual void begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
                     PixelShading shading, const PaintResources& resources = {}) = 0;
  /// Blends `splats` into the frame, in their order and behind or before all drawn so far: as order() says.
  /// The span is free when the call returns, but for those that drawsUnderWay() counts.
  virtual void draw(std::span<const ScreenSplat> splats) = 0;
  /// The last so many draws may still read their splats, where those lie in PaintingBackend::splatMemory().
  virtual size_t drawsUnderWay() const { return 0; }
  /// Waits until none is.
  virtual void finishDraws() {}
  /// Whether splats whose footprints lie in `box` change nothing, if they are drawn from now on: what would
  /// be seen of them is hidden. The picture's bits do not depend on whether they are drawn. Any thread,
  /// between begin() and end().
  virtual bool hides(const ScreenBox&) const { return false; }
  /// Waits for the drawing and gives the picture.
  virtual Image end() = 0;

  /// Of the calling thread, since begin(): taking splats over, and drawing them. OpenGL may draw later than
  /// it is told to: end() waits for it, and counts as drawing.
  virtual double uploadSeconds() const = 0;
  virtual double drawSeconds() const = 0;
  /// What OpenGL's own clock says of the drawing, without waits for splats; 0 where OpenGL does not draw.
  /// Complete after end().
  virtual double glSeconds() const { return 0; }
  /// Since begin(): of the splats drawn, those that were left out because nothing of them could be seen.
  virtual uint64_t hiddenSplats() const { return 0; }
};

}  // namespace curvisplat
