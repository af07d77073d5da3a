// Draws screen splats in compute shaders (OpenGL 4.3): the processor's painter on the card. Splats are listed for the
// tiles that their ellipses touch, each list is sorted by their keys there (tile_key.h), and every pixel goes through the
// list of its tile, front to back in registers, until nothing shines through.
//
//   draw -> batch -> GlTileLists: lists -> splatTileShader -> TilePicture -> end: the picture, or endOnCard: a texture
//
// A batch is collected in memory and sent at once; splats that its front cuts through stay for the next (tile_queues.h
// says why). Where its entries do not fit into `entries`, its tiles are drawn in several boxes. Neither how splats are
// batched nor the boxes change a bit. Stored bricks (stored_splats.h) are projected into the buffer before the batch; each
// batch lists what they have up to its front.
// Lives on the context's thread, but for hides(). Not built for: more than one frame at a time.
#pragma once

#include <cstdint>
#include <memory>

#include "render/gl/gl_context.h"
#include "render/project/painter.h"

namespace curvisplat {

class GlTilePainter final : public Painter {
 public:
  /// The capacity of the painter: `splats` of a batch, in memory and on the card, and `entries` of tiles' lists, 8 bytes each,
  /// there: at most those, of a card with little memory fewer. A picture whose entries do not fit is painted in boxes one after
  /// the other, and a box that leaves most of a card idle takes as long as the whole picture would.
  struct Capacity {
    size_t splats, entries;
    uint64_t buffer_bytes = UINT64_MAX;  // the most of a buffer of bricks, if OpenGL allows as many
    /// The capacity for a card, or for OpenGL in software, which the processor's memory holds.
    static Capacity of(bool software) {
      return software ? Capacity{65536, 1 << 19} : Capacity{1 << 18, 1 << 27};
    }
  };

  /// Compiles the programs. `context` outlives the painter. Throws Error where it has no compute shaders, or refuses ours.
  explicit GlTilePainter(const GlContext& context);
  GlTilePainter(const GlContext& context, const Capacity& capacity);
  ~GlTilePainter() override;

  void begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
             PixelShading shading, const PaintResources& resources = {}) override;
  void drawOnly(const TileSet& tiles) override;
  void draw(std::span<const ScreenSplat> splats) override;
  BrickStore* store() override;
  bool hides(const ScreenBox& box) const override;
  Image end() override;
  std::shared_ptr<CardPicture> endOnCard() override;

  double uploadSeconds() const override;
  double drawSeconds() const override;
  CardWork cardWork() const override;
  bool isOverfull() const override;

  /// The memory for a frame beside the picture itself.
  static uint64_t bytes(ImageSize size, const PaintResources& resources, const Capacity& capacity);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
