// The backends that this machine has: each is a painter together with the thread and the context that it
// needs.
//
// A painter is used in jobs, which run() runs on the painter's thread: the caller's for the processor, a
// thread of its own for OpenGL, which lives as long as the backend. One caller at a time. Making a backend
// loads the library that it draws with, and fails where the machine has none.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "render/project/painter.h"

namespace curvisplat {

class GlSharing;

enum class Backend {
  kAutomatic,  // OpenGL if a graphics card draws, otherwise the processor
  kOsmesa,     // OpenGL in software
  kEgl,  // OpenGL on a graphics card, or Mesa's software renderer if there is none: in compute shaders if it has them
  kEglQuads,  // the same, but with quads
  kCpu
};

/// A painter and the thread on which it may be used.
class PaintingBackend {
 public:
  virtual ~PaintingBackend() = default;

  using Job = std::function<void(Painter&)>;
  /// Runs `job` on the painter's thread and waits until it ends. Rethrows what `job` throws. One caller at a
  /// time.
  virtual void run(const Job& job) = 0;
  /// The name shown to users: "OSMesa 22.3.6, llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5, quads"; and why it is no better
  /// way of drawing, where one was asked for.
  virtual const std::string& name() const = 0;
  /// Whether the processor draws, either directly or through a software OpenGL.
  virtual bool isSoftware() const = 0;
  /// The backend that draws where this one cannot go on.
  virtual Backend next() const { return Backend::kCpu; }
  /// Memory in bytes that a frame of this size takes in addition to the resulting image.
  virtual uint64_t bytes(ImageSize size, const PaintResources& resources) const = 0;
};

/// Throws Error if the backend is not available; the message names the library that was tried and its error. `window`: of the
/// window that shows the pictures, or null. Compute shaders share its textures (Painter::endOnCard()) if they run where it is
/// drawn; otherwise the backend's name says why not. It outlives the backend.
std::unique_ptr<PaintingBackend> makeBackend(Backend backend, GlSharing* window = nullptr);

/// Replaces a backend that OpenGL has failed by the next one that this machine has: quads instead of compute shaders, unless it
/// is software that would draw them in a card's place; then the processor. Its name tells `why`. The backend is never null.
void replaceFailed(std::unique_ptr<PaintingBackend>& backend, const std::string& why);

/// The result of trying one backend on this machine.
struct BackendReport {
  std::string word;  // the value of --backend that selects it
  bool works = false;
  std::string found;  // its name, or why it does not work
};

/// The result of trying every backend, and which of them kAutomatic chooses and why.
struct SystemReport {
  std::vector<BackendReport> backends;
  std::string automatic;  // "cpu: no graphics card draws here"
};
SystemReport examineBackends();

}  // namespace curvisplat
