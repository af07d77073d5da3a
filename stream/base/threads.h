// Threads: how many an option asks for, their names in debuggers and in top, objects that each thread has of
// its own, and a team of threads that runs one job after another.
//
// A WorkerTeam owns its threads: it starts them when it is made and joins them when it is destroyed. One
// thread owns the team and starts its jobs; any thread may call the functions.
#pragma once

#include <pthread.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <new>
#include <thread>
#include <vector>

#include "stream/base/memory.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// `threads`, or the number of cores if it is 0.
inline unsigned threadsOrCores(unsigned threads) {
  return threads > 0 ? threads : std::max(1u, std::thread::hardware_concurrency());
}

/// Names the calling thread. `name`: at most 15 characters.
void nameThisThread(const char* name);

/// Starts `count` threads at once and ends them. Returns 0, or the system's error if they cannot be had, or if `spare_bytes` cannot be
/// mapped beside them (requireSpareMemory()). For libraries and pictures that would end the process, or wait for ever.
int errorOfThreads(unsigned count, size_t spare_bytes = kSpareBytes);

/// Objects of which each thread has its own, such as scratch memory. Make it a `static` variable of a function:
/// it lives as long as the process. A `thread_local` object with a destructor would do the same, but glibc ends
/// the process if it has no memory to note that destructor; this throws.
template <typename Object>
class PerThread {
 public:
  PerThread() {
    if (pthread_key_create(&key_, [](void* object) { delete static_cast<Object*>(object); }) != 0)
      throw std::bad_alloc();
  }
  PerThread(const PerThread&) = delete;
  PerThread& operator=(const PerThread&) = delete;

  /// The calling thread's object. It is made, by its default constructor, when the thread first asks for it, and
  /// destroyed when the thread ends; the main thread's stays until the process ends. Throws std::bad_alloc
  /// where there is no memory for it.
  Object& own() const {
    if (void* const known = pthread_getspecific(key_)) return *static_cast<Object*>(known);
    auto made = std::make_unique<Object>();
    if (pthread_setspecific(key_, made.get()) != 0) throw std::bad_alloc();
    return *made.release();
  }

 private:
  pthread_key_t key_;
};

/// A team of threads that run one job after another together. Each thread's own state (scratch memory, zstd
/// contexts) stays warm from one job to the next.
class WorkerTeam {
 public:
  /// Starts `count` threads, all named `name` (at most 15 characters).
  WorkerTeam(unsigned count, const char* name);
  /// Waits for the current job and ends the threads.
  ~WorkerTeam();
  WorkerTeam(const WorkerTeam&) = delete;
  WorkerTeam& operator=(const WorkerTeam&) = delete;

  unsigned size() const { return static_cast<unsigned>(threads_.size()); }
  /// Every thread calls job(number) with its own number, counted from 0. The job must not throw. One job at
  /// a time: call wait() before the next start().
  void start(std::function<void(unsigned)> job);
  /// Returns when all threads have ended the job; immediately if no job is running.
  void wait();

 private:
  void loop(unsigned number, const char* name);
  void end();

  Mutex mutex_;
  std::function<void(unsigned)> job_;        // set only while no thread is working
  uint64_t jobs_ GUARDED_BY(mutex_) = 0;     // started so far
  unsigned working_ GUARDED_BY(mutex_) = 0;  // threads still running the job
  bool ending_ GUARDED_BY(mutex_) = false;
  ConditionVariable started_, done_;
  std::vector<std::thread> threads_;
};

}  // namespace curvisplat
