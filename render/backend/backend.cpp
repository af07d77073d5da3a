#include "render/backend/backend.h"

#include <exception>
#include <utility>

#include "render/cpu/cpu_painter.h"
#include "render/gl/gl_context.h"
#include "render/gl/gl_painter.h"
#include "render/gl/gl_tile_painter.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// " (<why>)", or nothing.
std::string inBrackets(const std::string& why) {
  return why.empty() ? why : fmt::format(" ({})", why);
}

class GlBackend final : public PaintingBackend {
 public:
  enum class Way { kQuads, kTiles, kTilesOrQuads };

  /// `why`: quads, and nothing better; empty: they are what was asked for. `why_read`: compute shaders' pictures are read
  /// back for a window that shows them; empty: there is none.
  GlBackend(GlThread::MakeContext make, Way way, const std::string& why = {},
            const std::string& why_read = {})
      : gl_(std::move(make)), capacity_(GlTilePainter::Capacity::of(gl_.isSoftware())) {
    gl_.run([&](const GlContext& context) { makePainter(context, way, why, why_read); });
  }
  GlBackend(GlLibrary library, Way way, const std::string& why = {}, const std::string& why_read = {})
      : GlBackend([library] { return makeOffscreenContext(library); }, way, why, why_read) {}
  ~GlBackend() override {
    gl_.run([this](const GlContext&) { painter_.reset(); });
  }
  void run(const Job& job) override {
    gl_.run([&](const GlContext&) { job(*painter_); });
  }
  const std::string& name() const override { return name_; }
  bool isSoftware() const override { return gl_.isSoftware(); }
  Backend next() const override { return tiles_ ? Backend::kEglQuads : Backend::kCpu; }
  uint64_t bytes(ImageSize size, const PaintResources& resources) const override {
    return tiles_ ? GlTilePainter::bytes(size, resources, capacity_) : GlPainter::bytes(size, resources);
  }

 private:
  void makePainter(const GlContext& context, Way way, const std::string& why, const std::string& why_read) {
    name_ = context.name();
    std::string why_quads = inBrackets(why);
    if (way != Way::kQuads) {
      try {
        painter_ = std::make_unique<GlTilePainter>(context, capacity_);
        tiles_ = true;
        name_ += ", compute shaders" + inBrackets(why_read);
        return;
      } catch (const Error& error) {
        if (way == Way::kTiles) throw;
        why_quads = inBrackets(error.what());
      }
    }
    name_ += ", quads" + why_quads;
    painter_ = std::make_unique<GlPainter>(context);
  }

  GlThread gl_;
  const GlTilePainter::Capacity capacity_;
  bool tiles_ = false;
  std::string name_;
  std::unique_ptr<Painter> painter_;  // made, used and destroyed on the GL thread
};

/// Paints on the caller's thread and on TBB's threads.
class CpuBackend final : public PaintingBackend {
 public:
  explicit CpuBackend(const std::string& why = {}) : name_(CpuPainter::name() + inBrackets(why)) {}
  void run(const Job& job) override { job(painter_); }
  const std::string& name() const override { return name_; }
  bool isSoftware() const override { return true; }
  uint64_t bytes(ImageSize size, const PaintResources& resources) const override {
    return CpuPainter::frameBytes(size) + CpuPainter::batchBytes(size, resources);
  }

 private:
  CpuPainter painter_;
  const std::string name_;
};

/// Compute shaders in a context of the window's. Throws Error if there are none, or if they would run elsewhere than EGL's.
std::unique_ptr<GlBackend> makeSharingBackend(GlSharing& window) {
  static const std::string renderer = GlThread(GlLibrary::kEgl).renderer();  // of the first that was made
  if (renderer != window.renderer())
    throw Error("the window is drawn by {}, and pictures by {}", window.renderer(), renderer);
  return std::make_unique<GlBackend>([&window] { return window.makeContext(); }, GlBackend::Way::kTiles);
}

std::unique_ptr<GlBackend> makeEglBackend(GlSharing* window) {
  std::string why_read;
  try {
    if (window) return makeSharingBackend(*window);
  } catch (const Error& error) {
    why_read = fmt::format("read back for the window: {}", error.what());
  }
  return std::make_unique<GlBackend>(GlLibrary::kEgl, GlBackend::Way::kTilesOrQuads, "", why_read);
}

/// EGL if it draws on a graphics card. Otherwise returns null and sets `why_not`.
std::unique_ptr<PaintingBackend> makeCardBackend(std::string& why_not, GlSharing* window = nullptr) {
  try {
    if (!eglMayHaveCard()) {
      why_not = "EGL finds no graphics card";
      return nullptr;
    }
    auto card = makeEglBackend(window);
    if (!card->isSoftware()) return card;
    why_not = card->name() + " is software";
  } catch (const Error& error) {
    why_not = error.what();
  }
  return nullptr;
}

}  // namespace

std::unique_ptr<PaintingBackend> makeBackend(Backend backend, GlSharing* window) {
  switch (backend) {
    case Backend::kOsmesa:
      return std::make_unique<GlBackend>(GlLibrary::kOsmesa, GlBackend::Way::kQuads);
    case Backend::kEgl:
      return makeEglBackend(window);
    case Backend::kEglQuads:
      return std::make_unique<GlBackend>(GlLibrary::kEgl, GlBackend::Way::kQuads);
    case Backend::kCpu:
      return std::make_unique<CpuBackend>();
    case Backend::kAutomatic:
      break;
  }
  std::string why_not;
  if (auto card = makeCardBackend(why_not, window)) return card;
  return std::make_unique<CpuBackend>();
}

void replaceFailed(std::unique_ptr<PaintingBackend>& backend, const std::string& why) {
  const bool has_quads = backend->next() == Backend::kEglQuads, was_software = backend->isSoftware();
  backend = std::make_unique<CpuBackend>(why);  // which always draws; and the other one's memory is free
  if (!has_quads) return;
  try {
    auto quads = std::make_unique<GlBackend>(GlLibrary::kEgl, GlBackend::Way::kQuads, why);
    if (was_software || !quads->isSoftware()) backend = std::move(quads);
  } catch (const std::exception&) {  // whatever it is, the processor draws
  }
}

SystemReport examineBackends() {
  SystemReport report;
  const std::pair<const char*, Backend> backends[] = {{"egl", Backend::kEgl},
                                                      {"egl-quads", Backend::kEglQuads},
                                                      {"osmesa", Backend::kOsmesa},
                                                      {"cpu", Backend::kCpu}};
  for (const auto& [word, backend] : backends) {
    BackendReport& found = report.backends.emplace_back();
    found.word = word;
    try {
      found.found = makeBackend(backend)->name();
      found.works = true;
    } catch (const Error& error) {
      found.found = error.what();
    }
  }
  std::string why_not;
  report.automatic = makeCardBackend(why_not) ? "egl: a graphics card draws" : "cpu: " + why_not;
  return report;
}

}  // namespace curvisplat
