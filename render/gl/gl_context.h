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

/// Current on the thread that made it, and used and destroyed there only.
class GlContext {
 public:
  virtual ~GlContext() = default;
  GlContext(const GlContext&) = delete;
  GlContext& operator=(const GlContext&) = delete;

  const GlFunctions& functions() const { return functions_; }
  /// "OSMesa 22.3.6, llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5"
  const std::string& name() const { return name_; }
  /// Whether the processor draws: no graphics card does.
  bool isSoftware() const { return software_; }

 protected:
  GlContext(const std::string& library, const GlFunctions::Lookup& lookup);

 private:
  GlFunctions functions_;
  std::string name_;
  bool software_ = true;
};

/// Mesa keeps compiled shaders in the user's cache folder, in a file that is mapped into memory before the disk has room for it:
/// on a full disk, or where the user's quota is used up, SIGBUS would end the process. Looks, once, whether there is room, and
/// where there is none sets the variable that keeps Mesa from it. Call it before the first context is made.
void keepMesaOffAFullDisk();

/// The libraries that give a context without a window.
enum class GlLibrary { kOsmesa, kEgl };

/// Makes a core context of OpenGL 3.3 or newer, current on the calling thread. Throws Error that names
/// what was tried and its error.
std::unique_ptr<GlContext> makeOffscreenContext(GlLibrary library);

/// Makes a context by EGL, which has OpenGL on a graphics card without a display, and in software where
/// there is none. Asks every device of the machine, graphics cards before software, then Mesa's surfaceless
/// platform. Throws Error with the error of each of them.
std::unique_ptr<GlContext> makeEglContext();

/// Whether EGL knows of a device that is not software, or cannot tell. Much quicker than a context. Throws
/// Error where there is no EGL.
bool eglMayHaveCard();

/// Makes a context by OSMesa: OpenGL in software, into memory, without a display or a GPU. Throws Error with
/// the names tried and the loader's error, or if OSMesa gives no context.
std::unique_ptr<GlContext> makeOsMesaContext();

/// The one thread that owns the OpenGL context. All calls of OpenGL run on it, in jobs that the caller waits
/// for.
class GlThread {
 public:
  /// Starts the thread, named "gl", and makes the context on it. Throws what makeOffscreenContext() throws.
  explicit GlThread(GlLibrary library);
  ~GlThread();
  GlThread(const GlThread&) = delete;
  GlThread& operator=(const GlThread&) = delete;

  using Job = std::function<void(const GlContext&)>;
  /// Runs `job` on the thread and waits for its end. Throws what it throws. One caller at a time.
  void run(const Job& job);

  /// GlContext::name() and isSoftware() of the context.
  const std::string& contextName() const { return context_name_; }
  bool isSoftware() const { return software_; }

 private:
  void loop();

  Mutex mutex_;
  ConditionVariable changed_;
  const Job* job_ GUARDED_BY(mutex_) = nullptr;  // the job to run; null once it has run
  std::exception_ptr error_ GUARDED_BY(mutex_);  // of the last job
  bool stopping_ GUARDED_BY(mutex_) = false;

  const GlLibrary library_;
  std::string context_name_;
  bool software_ = true;
  std::thread thread_;
};

}  // namespace curvisplat
