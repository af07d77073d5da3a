// A team of threads that run one job after another together. Each thread's own state (scratch, zstd contexts)
// stays warm from one job to the next.
#pragma once

#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

#include "stream/base/mutex.h"

namespace curvisplat {

class WorkerTeam {
 public:
  /// Starts `count` threads, all named `name` (at most 15 characters).
  WorkerTeam(unsigned count, const char* name);
  /// Waits for the current job and ends the threads.
  ~WorkerTeam();
  WorkerTeam(const WorkerTeam&) = delete;
  WorkerTeam& operator=(const WorkerTeam&) = delete;

  unsigned size() const { return static_cast<unsigned>(threads_.size()); }
  /// Every thread calls job(number) with its own number, counted from 0. The job must not throw. One job at a
  /// time: call wait() before the next start().
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
