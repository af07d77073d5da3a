// The one thread that owns the OpenGL context. All calls of OpenGL run on it, in jobs that the caller waits
// for.
#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "render/gl/gl_context.h"
#include "render/gl/offscreen_context.h"
#include "stream/base/mutex.h"

namespace curvisplat {

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

  /// Of the context: GlContext::name() and isSoftware().
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
