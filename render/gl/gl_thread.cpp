#include "render/gl/gl_thread.h"

#include <utility>

#include "render/gl/offscreen_context.h"
#include "stream/base/thread_name.h"

namespace curvisplat {

GlThread::GlThread(GlLibrary library) : library_(library) {
  const Job first = [this](const GlContext& context) {
    context_name_ = context.name();
    software_ = context.isSoftware();
  };
  job_ = &first;  // loop() makes the context before it runs a job
  thread_ = std::thread([this] { loop(); });
  MutexLock lock(mutex_);
  while (job_) changed_.wait(lock);
  if (!error_) return;
  lock.unlock();
  thread_.join();
  std::rethrow_exception(error_);
}

GlThread::~GlThread() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void GlThread::run(const Job& job) {
  MutexLock lock(mutex_);
  job_ = &job;
  changed_.notify_all();
  while (job_) changed_.wait(lock);
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

void GlThread::loop() {
  nameThisThread("gl");
  std::unique_ptr<GlContext> context;
  MutexLock lock(mutex_);
  while (true) {
    while (!job_ && !stopping_) changed_.wait(lock);
    if (!job_) return;
    const Job& job = *job_;
    lock.unlock();
    std::exception_ptr error;
    try {
      if (!context) context = makeOffscreenContext(library_);
      job(*context);
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    error_ = error;
    job_ = nullptr;
    changed_.notify_all();
    if (!context) return;
  }
}

}  // namespace curvisplat
