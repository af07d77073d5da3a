// A painter that fails only at the end: where several ranks draw a picture together, each has to exchange splats to the end,
// or the others would wait for it. Then all of them draw the picture again (FramePipeline::drawInRegions()).
#pragma once

#include <atomic>
#include <exception>
#include <utility>

#include "render/project/painter.h"
#include "render/project/painter_failure.h"

namespace curvisplat {

class EnduringPainter final : public Painter {
 public:
  /// `painter` must outlive this. Once it has thrown a PainterFailure, it is called no more.
  explicit EnduringPainter(Painter& painter) : painter_(painter) {}

  /// Returns what the painter threw; null if it has not failed.
  const std::exception_ptr& failure() const { return failure_; }

  void begin(ImageSize size, const glm::vec4& background, const ClassificationTable& table,
             PixelShading shading, const PaintResources& resources) override {
    attempt([&] { painter_.begin(size, background, table, shading, resources); });
  }
  void drawOnly(const TileSet& tiles) override {
    attempt([&] { painter_.drawOnly(tiles); });
  }
  void draw(std::span<const ScreenSplat> splats) override {
    attempt([&] { painter_.draw(splats); });
  }
  bool hides(const ScreenBox& box) const override { return !has_failed_ && painter_.hides(box); }
  /// An empty image if the painter has failed.
  Image end() override {
    Image image;
    attempt([&] { image = painter_.end(); });
    return image;
  }

  double uploadSeconds() const override { return painter_.uploadSeconds(); }
  double drawSeconds() const override { return painter_.drawSeconds(); }
  CardWork cardWork() const override { return has_failed_ ? CardWork{} : painter_.cardWork(); }
  bool isOverfull() const override { return !has_failed_ && painter_.isOverfull(); }
  uint64_t hiddenSplats() const override { return painter_.hiddenSplats(); }

 private:
  template <typename Call>
  void attempt(const Call& call) {
    if (has_failed_) return;
    try {
      call();
    } catch (const PainterFailure&) {
      failure_ = std::current_exception();
      has_failed_ = true;
    }
  }

  Painter& painter_;
  std::exception_ptr failure_;
  std::atomic<bool> has_failed_ = false;  // any thread may ask hides()
};

}  // namespace curvisplat
