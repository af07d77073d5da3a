// Threads that do the same job together, again and again: what a thread keeps for itself (scratch, zstd
// contexts) stays warm from one job to the next.
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
  /// Waits for the job's end.
  ~WorkerTeam();
  WorkerTeam(const WorkerTeam&) = delete;
  WorkerTeam& operator=(const WorkerTeam&) = delete;

  unsigned size() const { return static_cast<unsigned>(threads_.size()); }
  /// Every thread calls job(its number, from 0), which must not throw. One job at a time: the one before has
  /// been waited for.
  void start(std::function<void(unsigned)> job);
  /// Until all have ended the job. At once if there is none.
  void wait();

 private:
  void loop(unsigned number, const char* name);
  void end();

  std::mutex mutex_;  // guards the four below
  std::function<void(unsigned)> job_;
  uint64_t jobs_ = 0;     // started so far
  unsigned working_ = 0;  // threads that have not ended the job
  bool ending_ = false;
  std::condition_variable started_, done_;
  std::vector<std::thread> threads_;
};

}  // namespace curvisplat
