#include "render/backend.h"

#include "render/cpu_painter.h"
#include "render/gl_painter.h"
#include "render/gl_thread.h"

namespace curvisplat {
namespace {

class GlBackend final : public PaintingBackend {
 public:
  GlBackend() {
    gl_.run([this](const GlContext& context) { painter_ = std::make_unique<GlPainter>(context); });
  }
  ~GlBackend() override {
    gl_.run([this](const GlContext&) { painter_.reset(); });
  }
  void run(const Job& job) override {
    gl_.run([&](const GlContext&) { job(*painter_); });
  }
  const std::string& name() const override { return gl_.contextName(); }
  std::span<ScreenSplat> splatMemory(size_t count) override {
    std::span<ScreenSplat> mapped;
    gl_.run([&](const GlContext&) { mapped = painter_->mapSplats(count); });
    return mapped.empty() ? PaintingBackend::splatMemory(count) : mapped;
  }
  uint64_t bytes(ImageSize size, const PaintResources&) const override {
    return uint64_t{4} * sizeof(float) * static_cast<uint64_t>(size.width) *
           static_cast<uint64_t>(size.height);  // the framebuffer
  }

 private:
  GlThread gl_;
  std::unique_ptr<GlPainter> painter_;  // made, used and destroyed on the GL thread
};

/// Paints on the caller's thread, and on TBB's.
class CpuBackend final : public PaintingBackend {
 public:
  void run(const Job& job) override { job(painter_); }
  const std::string& name() const override { return name_; }
  uint64_t bytes(ImageSize size, const PaintResources& resources) const override {
    return CpuPainter::frameBytes(size) + CpuPainter::batchBytes(size, resources);
  }

 private:
  CpuPainter painter_;
  const std::string name_ = CpuPainter::name();
};

}  // namespace

std::span<ScreenSplat> PaintingBackend::splatMemory(size_t count) {
  splats_.reset();
  splats_ = std::make_unique_for_overwrite<ScreenSplat[]>(count);
  return {splats_.get(), count};
}

std::unique_ptr<PaintingBackend> makeBackend(Backend backend) {
  // The only OpenGL so far is OSMesa, which is software.
  if (backend == Backend::osmesa) return std::make_unique<GlBackend>();
  return std::make_unique<CpuBackend>();
}

}  // namespace curvisplat
