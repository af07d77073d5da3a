// How far a job is, in phases, for whoever displays it; and whether the job has been asked to stop.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/process_usage.h"

namespace curvisplat {

/// The job was asked to stop, and did: not a failure, but an end.
class Interrupted : public Error {
 public:
  Interrupted(int signal, const std::string& text) : Error(text), signal_(signal) {}
  /// What Progress::stop() was given.
  int signal() const { return signal_; }

 private:
  int signal_;
};

/// Progress of a job in phases. begin() is for the thread that runs the job; advance() is for any thread and
/// costs an atomic addition.
class Progress {
 public:
  /// The phase that is under way.
  struct State {
    std::string phase, unit;
    uint64_t total = 0;  // steps; 0: unknown
    uint64_t done = 0;   // steps, without those that were skipped
    uint64_t skipped = 0;
    double seconds = 0;
  };
  /// Shows a state; nullptr ends the phase. Called by any thread, by one at a time.
  using Display = std::function<void(const State*)>;

  /// Calls `display`, if there is one, at most ten times a second.
  explicit Progress(Display display = {}) : display_(std::move(display)) {}
  ~Progress();

  /// Ends the phase before and begins `phase`, of `total` steps of `unit` ("nodes", "bricks"). 0 is
  /// "unknown".
  void begin(std::string phase, uint64_t total, std::string unit);
  /// Throws Interrupted after stop().
  void advance(uint64_t steps);
  /// Counts steps that were done before the job began: for the percentage, not for the rate.
  void skip(uint64_t steps);
  /// Ends the last phase.
  void end();

  /// Asks the job to stop, for the signal's sake, at its next throwIfStopped(). Any thread, and safe in a
  /// signal handler.
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
    uint64_t steps = 0;  // without those that were skipped
    ProcessUsage usage;  // during the phase; but the peak of memory is that of all until its end
  };
  /// The phases that have ended, for --stats.
  const std::vector<Phase>& phases() const { return phases_; }

 private:
  void show();

  const Display display_;
  const Progress* outer_ = nullptr;
  std::string phase_, unit_;
  uint64_t total_ = 0;
  std::atomic<uint64_t> done_ = 0, skipped_ = 0;
  std::atomic<int> stop_signal_ = 0;  // 0: go on
  static_assert(std::atomic<int>::is_always_lock_free);
  std::atomic<int64_t> next_display_ms_ = 0;
  std::chrono::steady_clock::time_point start_;
  ProcessUsage usage_at_start_;
  std::mutex displaying_;  // held while display_ is called
  std::vector<Phase> phases_;
};

}  // namespace curvisplat
