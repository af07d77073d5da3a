// An OpenGL context to draw in without a window, from whatever library the machine has, and the thread that
// owns it.
//
//   GlThread -> makeOffscreenContext -> EGL: graphics cards without a display, or software
//                                    -> OSMesa: software, into memory
//
// Libraries are loaded at run time, when a context is made: nothing is linked. A context is current on the
// thread that made it, and is used and destroyed there only; a program asks a GlThread to run jobs on it.
#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "render/gl/gl_functions.h"
#include "stream/base/mutex.h"

namespace curvisplat {

class SharedBin;

/// A context that is current on the thread that made it, and is used and destroyed there only.
class GlContext {
 public:
  virtual ~GlContext() = default;
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  const GlFunctions& functions() const { return functions_; }
  /// The library, the device and the version, such as "OSMesa 22.3.6, llvmpipe (LLVM 15.0.6, 256 bits),
  /// OpenGL 4.5".
  const std::string& name() const { return name_; }
  /// The name of what draws, OpenGL's GL_RENDERER: "llvmpipe (LLVM 15.0.6, 256 bits)".
  const std::string& renderer() const { return renderer_; }
  /// Whether the processor draws, not a graphics card.
  bool isSoftware() const { return software_; }
  /// The bin of the window's OpenGL that the context shares textures with (GlSharing); null: it shares none.
  const std::shared_ptr<SharedBin>& shared() const { return shared_; }

 protected:
  GlContext(const std::string& library, const GlFunctions::Lookup& lookup,
            std::shared_ptr<SharedBin> shared = nullptr);

 private:
  GlFunctions functions_;
  std::string name_, renderer_;
  bool software_ = true;
  std::shared_ptr<SharedBin> shared_;
};

/// Whether a renderer of this name is the processor: software renderers are known by the names that they give themselves.
bool isSoftwareRenderer(const std::string& renderer);

/// The OpenGL of a window, for painters on other threads whose pictures it shows without a copy (card_picture.h). Outlives
/// the contexts. Any thread.
class GlSharing {
 public:
  virtual ~GlSharing() = default;
  /// GlContext::renderer() of the window.
  virtual const std::string& renderer() const = 0;
  /// Makes a context that shares the window's textures, current on the calling thread. Throws Error, which says why there
  /// is none. One at a time.
  virtual std::unique_ptr<GlContext> makeContext() = 0;
};

/// Turns off Mesa's file of compiled shaders if the disk of the user's cache folder is full. Mesa maps that
/// file into memory before the disk has space for it, so a full disk or an exhausted quota would end the
/// process with SIGBUS. Checks once, and sets an environment variable. Call it before the first context is
/// made.
void keepMesaOffAFullDisk();

/// The libraries that give a context without a window.
enum class GlLibrary { kOsmesa, kEgl };

/// Makes a core context of OpenGL 3.3 or newer, current on the calling thread. Throws Error, which names what
/// was tried and why it failed.
std::unique_ptr<GlContext> makeOffscreenContext(GlLibrary library);

/// Makes a context by EGL, on a graphics card without a display, or in software if there is none. Tries every
/// device of the machine, graphics cards before software, then Mesa's surfaceless platform. Throws Error,
/// which says why each of them failed.
std::unique_ptr<GlContext> makeEglContext();

/// Whether EGL lists a device that is not software, or cannot list devices. Much quicker than making a
/// context. Throws Error if there is no EGL.
bool eglMayHaveCard();

/// Makes a context by OSMesa, which draws in software, into memory, without a display. Throws Error if the
/// library is not found (with the names tried and the loader's error) or gives no context.
std::unique_ptr<GlContext> makeOsMesaContext();

/// The one thread that owns the OpenGL context. All calls of OpenGL run on it, in jobs that the caller waits
/// for.
class GlThread {
 public:
  using MakeContext = std::function<std::unique_ptr<GlContext>()>;
  /// Starts the thread, named "gl", and makes the context on it. Throws what `make` throws.
  explicit GlThread(MakeContext make);
  explicit GlThread(GlLibrary library) : GlThread([library] { return makeOffscreenContext(library); }) {}
  ~GlThread();
  GlThread(const GlThread&) = delete;
  GlThread& operator=(const GlThread&) = delete;

  using Job = std::function<void(const GlContext&)>;
  /// Runs `job` on the thread and waits for its end. Throws what it throws. One caller at a time.
  void run(const Job& job);

  /// GlContext::name(), renderer() and isSoftware() of the context.
  const std::string& contextName() const { return context_name_; }
  const std::string& renderer() const { return renderer_; }
  bool isSoftware() const { return software_; }

 private:
  void loop();

  Mutex mutex_;
  ConditionVariable changed_;
  const Job* job_ GUARDED_BY(mutex_) = nullptr;  // the job to run; null once it has run
  std::exception_ptr error_ GUARDED_BY(mutex_);  // of the last job
  bool stopping_ GUARDED_BY(mutex_) = false;

  const MakeContext make_;
  std::string context_name_, renderer_;
  bool software_ = true;
  std::thread thread_;
};

}  // namespace curvisplat
