// A team of threads that run one job after another together. Each thread's own state (scratch, zstd contexts)
// stays warm from one job to the next.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

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

  std::mutex mutex_;  // guards the four below
  std::function<void(unsigned)> job_;
  uint64_t jobs_ = 0;     // started so far
  unsigned working_ = 0;  // threads still running the job
  bool ending_ = false;
  std::condition_variable started_, done_;
  std::vector<std::thread> threads_;
};

}  // namespace curvisplat
