// The ways there are to draw, and the thread that each is to be used on.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "render/project/painter.h"

namespace curvisplat {

enum class Backend {
  kAutomatic,  // OpenGL where a graphics card draws, else the processor
  kOsmesa,     // OpenGL in software
  kEgl,        // OpenGL of a graphics card, or of Mesa's software where there is none
  kCpu
};

/// A painter, and where it may be used.
class PaintingBackend {
 public:
  virtual ~PaintingBackend() = default;

  using Job = std::function<void(Painter&)>;
  /// Runs `job` on the painter's thread and waits for its end. Throws what it throws. One caller at a time.
  virtual void run(const Job& job) = 0;
  /// The painter's.
  virtual DrawingOrder order() const = 0;
  /// For people: "OSMesa 22.3.6, llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5"
  virtual const std::string& name() const = 0;
  /// Whether the processor draws, by itself or below OpenGL.
  virtual bool isSoftware() const = 0;
  /// Memory for so many splats, to be drawn from without copying them where the painter can. It takes the
  /// place of what was given before.
  virtual std::span<ScreenSplat> splatMemory(size_t count);
  /// Beside the result, for a frame of this size.
  virtual uint64_t bytes(ImageSize size, const PaintResources& resources) const = 0;

 private:
  std::unique_ptr<ScreenSplat[]> splats_;
};

/// Throws Error if that cannot be had: which library was tried, and what it said.
std::unique_ptr<PaintingBackend> makeBackend(Backend backend);

/// One way to draw, as found on this machine.
struct BackendReport {
  std::string word;  // of --backend
  bool works = false;
  std::string found;  // its name, or why it does not work
};

/// Every backend but automatic, tried, and what automatic takes and why.
struct SystemReport {
  std::vector<BackendReport> backends;
  std::string automatic;  // "cpu: no graphics card draws here"
};
SystemReport examineBackends();

}  // namespace curvisplat
