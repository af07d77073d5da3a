// The interface of painters, which draw screen splats with OpenGL or on the processor.
//
//   begin -> draw, draw, ... (nearest first) -> end
//
// Colours are premultiplied. A painter draws one frame at a time. All calls but hides() are on the thread of
// its backend.
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <memory>
#include <span>
#include <stop_token>

#include "render/colour/classification.h"
#include "render/image/image.h"
#include "render/project/pixel_layers.h"
#include "render/project/screen_splat.h"
#include "render/project/screen_view.h"
#include "render/project/tile_set.h"
#include "stream/base/compute_permits.h"
#include "stream/paging/cut.h"

namespace curvisplat {

class BrickStore;
class CardPicture;

/// The resources that a painter may use for a frame. OpenGL's driver does not keep to them.
struct PaintResources {
  unsigned threads = 0;           // 0: one per core
  size_t batch_splats = 65536;    // the most splats that may be collected and drawn together
  size_t waiting_splats = 65536;  // the most splats that may wait for others in tiles (tile_key.h)
  std::stop_token stop =
      {};  // once it is requested, the rest may be left out: nobody wants the picture any more
  ComputePermits* permits =
      nullptr;  // threads hold one while they compute; must outlive the frame. Null: no further bound

  /// The bytes that all threads together may keep of splats that they have prepared, and need again.
  uint64_t preparedBytes() const { return kPreparedBytesASplat * waiting_splats; }
  static constexpr uint64_t kPreparedBytesASplat = 32;  // that may wait
};

/// How the pixels of a splat get their colours.
struct PixelShading {
  bool per_pixel = true;  // from the splat's slope and width; false: one colour and extinction per splat
  bool lit = false;       // splats carry light (light.h)
  const PixelLayers* layers = nullptr;  // of all pixels of the picture; must outlive the frame; null: none
  /// The table that gives the colours in a picture of two scalars, with extinction 1. It is for the scalar in
  /// the splats' ScreenColours, which all splats have then; the table of begin() gives only the extinctions.
  /// Must outlive the frame; null: the picture has one scalar.
  const ClassificationTable* colours = nullptr;
  float low_pass_px2 = static_cast<float>(kLowPass);  // ScreenView's
};

/// The work of OpenGL for a frame, by its own clock, without waits for splats. The parts are those of compute
/// shaders.
struct CardWork {
  double draw_s = 0;  // all of it
  double project_s = 0, list_s = 0, sort_s = 0, paint_s = 0;
  uint64_t entries = 0;     // splats in tiles, each once in every tile
  uint64_t bytes = 0;       // the most memory that OpenGL's objects have taken so far
  uint64_t sent_bytes = 0;  // of bricks that stay on the card: sent for this frame
  uint64_t slabs = 0;       // of depth, in which stored bricks were projected
  uint64_t read_bytes = 0;  // of the picture, by the processor
  uint64_t pixels_listed = 0,
           pixels_blended = 0;  // PixelCounts (render/gl/pixel_counts.h); 0 unless they are wanted
};

/// Draws the splats of a frame. One frame at a time.
class Painter {
 public:
  virtual ~Painter() = default;

  /// Begins a frame filled with `background`. `table` outlives the frame. Throws Error where the image is
  /// larger than the painter's limit, which it names.
  virtual void begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
                     PixelShading shading, const PaintResources& resources = {}) = 0;
  /// Restricts drawing to `tiles`, which fill their bounding box, until the next call. Call it after begin().
  /// No two calls of a frame may share a square of kTileSide pixels, and all splats of one call's tiles are
  /// drawn before the next call. Pixels in no call's tiles have no meaningful value.
  virtual void drawOnly(const TileSet& tiles) = 0;
  /// Blends `splats` into the frame, behind all splats drawn so far and each behind those before it. Only
  /// splats whose depth differs between tiles (leans(), tile_key.h) are blended in each tile's own order. The
  /// memory may be used again when the call returns.
  virtual void draw(std::span<const ScreenSplat> splats) = 0;
  /// Returns the place where bricks may stay and be projected; null: the painter has none.
  virtual BrickStore* store() { return nullptr; }
  /// Whether all splats drawn from now on whose footprints lie in `box` would be hidden. The picture's bits
  /// do not depend on whether they are drawn. Any thread may ask between begin() and end().
  virtual bool hides(const ScreenBox&) const { return false; }
  /// Waits until everything is drawn and returns the picture.
  virtual Image end() = 0;

  /// Seconds that the calling thread has spent since begin() on taking splats over and on drawing them.
  /// OpenGL may draw later than the call; end() waits for it, and this wait counts as drawing.
  virtual double uploadSeconds() const = 0;
  virtual double drawSeconds() const = 0;
  /// The work of OpenGL; all zeros if it does not draw. Complete after end().
  virtual CardWork cardWork() const { return {}; }
  /// Whether more splats waited for others than PaintResources allow, so that the picture is wrong. Known
  /// after end(). Smaller regions of it need fewer.
  virtual bool isOverfull() const { return false; }
  /// How many of the splats given to draw() since begin() were left out because they are hidden completely.
  virtual uint64_t hiddenSplats() const { return 0; }
  /// Does what end() does, but leaves the picture on the card, for the window that the painter shares textures with. Returns
  /// null if it shares none; then end() has to be called.
  virtual std::shared_ptr<CardPicture> endOnCard() { return nullptr; }
};

}  // namespace curvisplat
