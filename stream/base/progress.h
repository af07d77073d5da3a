// The progress of a job: its phases, for the display and for --stats, with the time and resources that each
// took, and requests to stop the job.
//
// One thread runs a job and begins its phases. Any thread counts steps, which costs an atomic addition, and
// any thread, even a signal handler, asks the job to stop. The job then ends with the exception Interrupted,
// which advance() and throwIfStopped() throw.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// The system's counters of this process.
struct ProcessUsage {
  double cpu_seconds = 0;   // all threads, user and system time
  uint64_t bytes_read = 0;  // by system calls, from the page cache or the disk
  uint64_t bytes_written = 0;
  uint64_t memory_bytes = 0;       // VmRSS: resident memory
  uint64_t peak_memory_bytes = 0;  // VmHWM: the largest VmRSS so far

  /// Totals since the process started; 0 for numbers that the system does not provide. Any thread; takes
  /// about 20 us.
  static ProcessUsage now();
};

/// Thrown by work that was asked to stop, by Progress::stop() or a std::stop_token. Not a failure.
class Interrupted : public Error {
 public:
  Interrupted(int signal, const std::string& text) : Error(text), signal_(signal) {}
  /// The signal that Progress::stop() was given; 0: none.
  int signal() const { return signal_; }

 private:
  int signal_;
};

/// Throws Interrupted once a stop of `token` was requested. Any thread; costs a load.
inline void throwIfStopped(const std::stop_token& token) {
  if (token.stop_requested()) throw Interrupted(0, "interrupted");
}

/// Progress of a job in phases. begin(), skip() and end() are for the thread that runs the job, advance()
/// for any thread.
class Progress {
 public:
  /// The current phase.
  struct State {
    std::string phase, unit;
    uint64_t total = 0;  // steps; 0: unknown
    uint64_t done = 0;   // steps, without the skipped ones
    uint64_t skipped = 0;
    double seconds = 0;
  };
  /// Shows a state; nullptr ends the phase. Called from any thread, but only from one at a time.
  using Display = std::function<void(const State*)>;

  /// Calls `display`, if it is set, at most ten times a second.
  explicit Progress(Display display = {}) : display_(std::move(display)) {}
  ~Progress();

  /// Ends the previous phase and begins `phase`. `total`: its number of steps, 0 if unknown. `unit`: what a
  /// step is ("nodes", "bricks").
  void begin(std::string phase, uint64_t total, std::string unit);
  /// Counts steps that were done. Throws Interrupted after stop().
  void advance(uint64_t steps);
  /// Counts steps that were done before the job began: they raise the percentage but not the rate.
  void skip(uint64_t steps);
  /// Ends the last phase.
  void end();

  /// Asks the job to stop at its next throwIfStopped() because of `signal`. Any thread; safe in a signal
  /// handler, which std::stop_source is not.
  void stop(int signal) { stop_signal_ = signal; }
  /// Throws Interrupted after stop(). Any thread; costs a load.
  void throwIfStopped() const {
    if (const int signal = stop_signal_.load(std::memory_order_relaxed))
      throw Interrupted(signal, "interrupted");
    if (outer_) outer_->throwIfStopped();
  }
  /// stop() of `outer` stops this job as well, which is a part of that one. `outer` outlives it.
  void stopWith(const Progress& outer) { outer_ = &outer; }

  struct Phase {
    std::string name;
    std::string unit;
    double seconds = 0;
    uint64_t steps = 0;  // without the skipped ones
    ProcessUsage usage;  // during the phase; except peak memory, which is since the process started
  };
  /// The phases that have ended. For --stats.
  const std::vector<Phase>& phases() const { return phases_; }

 private:
  void show();

  const Display display_;
  const Progress* outer_ = nullptr;
  std::string phase_, unit_;
  uint64_t total_ = 0;
  std::atomic<uint64_t> done_ = 0, skipped_ = 0;
  std::atomic<int> stop_signal_ = 0;  // 0: continue
  static_assert(std::atomic<int>::is_always_lock_free);
  std::atomic<int64_t> next_display_ms_ = 0;
  std::chrono::steady_clock::time_point start_;
  ProcessUsage usage_at_start_;
  Mutex displaying_;  // held while display_ is called
  std::vector<Phase> phases_;
};

}  // namespace curvisplat
