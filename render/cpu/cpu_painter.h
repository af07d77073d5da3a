// Draws screen splats on the processor's cores: batches of splats, sorted into the tiles that they touch;
// every tile painted by one thread, in vectors (tile.h), or by several if it has too many of the splats. DESIGN.md,
// "Painting".
//
// Splats are blended nearest first, each under those before it. Splats that change no channel by 1/4096 or
// more are left out (tile.h). There is no painter from back to front: this order is cheaper even where
// nothing is hidden, by two multiplications a pixel.
//
// The picture's bits depend neither on threads nor on batches: a pixel's splats are blended one after the
// other, in their order.
//
// Any thread, one at a time. It works on that one and on TBB's (PaintLoop in splat_bins.h).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "render/project/painter.h"

namespace curvisplat {

class CpuPainter final : public Painter {
 public:
  CpuPainter();
  ~CpuPainter() override;

  void begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
             PixelShading shading, const PaintResources& resources = {}) override;
  void drawOnly(const TileSet& tiles) override;
  void draw(std::span<const ScreenSplat> splats) override;
  bool hides(const ScreenBox& box) const override;
  Image end() override;

  double uploadSeconds() const override;
  double drawSeconds() const override;
  uint64_t hiddenSplats() const override;
  bool isOverfull() const override;

  /// The memory for a frame beside the picture itself.
  static uint64_t frameBytes(ImageSize size);
  static uint64_t batchBytes(ImageSize size, const PaintResources& resources);
  static uint64_t layerBytes(const PixelLayers& layers);
  /// "CPU, AVX3"
  static std::string name();
  /// Highway's numbers of the instruction sets that it can paint with here, the best first.
  static std::vector<int64_t> targets();
  /// Whether one has fused multiply-adds. All that do draw the same bits.
  static bool fuses(int64_t target);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace curvisplat
