// Bounds how many threads compute at a time, whoever started them, and measures how long stages of their
// work take. A frame has workers, the painter's threads, and the thread that writes the last picture; a
// conversion has TBB's threads, and those that read ahead of them. There are as many permits as `--threads`
// says. A thread holds one while it computes, and gives it back while it waits for another thread or for the
// disk:
//
//   Computing computing(permits);     // holds a permit to the end of the scope, except
//   { WaitTimer waiting(...); ... }   // in here, whose time is measured,
//   Computing::giveWay();             // and here, if an urgent thread waits for a permit
//
// No permit is idle while a thread waits for one. A thread with a permit waits for nothing that needs one,
// so there is no deadlock. Urgent threads come first: those that prepare splats, until the ring between them
// and the painter is full, and those that read, until all that they may read ahead is there. Otherwise the
// painter would run out of splats, and then wait while one worker waits for another.
//
// Taking a permit and giving it back cost a mutex each (20 ns), so they surround bricks and batches, never
// splats.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <utility>

#include "stream/base/mutex.h"
#include "stream/base/trace.h"

namespace curvisplat {

enum class Urgency { kNormal, kUrgent };

/// Thread-safe. Outlives whoever holds one of its permits.
class ComputePermits {
 public:
  explicit ComputePermits(unsigned count) : count_(count), free_(count) {}
  ComputePermits(const ComputePermits&) = delete;
  ComputePermits& operator=(const ComputePermits&) = delete;

  unsigned count() const { return count_; }
  /// Wakes the threads that wait, so that they ask their `unneeded` (Computing) again: what it returns may
  /// have changed.
  void recheck();
  /// Whether an urgent thread waits for a permit.
  bool isWantedUrgently() const { return urgent_.load(std::memory_order_relaxed) > 0; }

 private:
  friend class Computing;
  friend class GivenBackPermit;

  using Unneeded = std::function<bool()>;
  bool acquire(Urgency urgency, const Unneeded& unneeded = {});
  void giveBack();
  void wakeNext() REQUIRES(mutex_);

  const unsigned count_;
  Mutex mutex_;
  ConditionVariable for_urgent_, for_others_;
  unsigned free_ GUARDED_BY(mutex_);
  std::atomic<unsigned> urgent_ = 0;  // threads that wait; written with the mutex held
};

/// Holds a permit for this thread.
class Computing {
 public:
  /// Waits for a permit. Does nothing if `permits` is null, which means that there is no bound, or if this
  /// thread holds a permit already.
  explicit Computing(ComputePermits* permits, Urgency urgency = Urgency::kNormal)
      : Computing(permits, urgency, {}) {}
  /// The same, but stops waiting when `unneeded` returns true. It is called each time that the thread wakes.
  Computing(ComputePermits* permits, Urgency urgency, const std::function<bool()>& unneeded);
  ~Computing();
  Computing(const Computing&) = delete;
  Computing& operator=(const Computing&) = delete;

  /// The permits of which this thread holds one; null if it holds none.
  static ComputePermits* ofThisThread();
  /// False if the permit was not needed any more.
  bool granted() const { return granted_; }
  /// Lets a thread that is urgent have this thread's permit, if it has one, and waits for another.
  static void giveWay();

 private:
  friend class GivenBackPermit;

  ComputePermits* permits_ = nullptr;  // null: holds none of its own
  Urgency urgency_ = Urgency::kNormal;
  bool granted_ = true;
};

/// Gives this thread's permit back, if it holds one, for a scope in which it waits for something else.
class GivenBackPermit {
 public:
  GivenBackPermit();
  ~GivenBackPermit();
  GivenBackPermit(const GivenBackPermit&) = delete;
  GivenBackPermit& operator=(const GivenBackPermit&) = delete;

 private:
  Computing* const of_;
};

/// Wraps the `work` of a parallel loop: its threads take a permit for each call if this thread, which begins
/// the loop, holds one. Each call gives way to urgent threads first.
template <typename Work>
auto withPermit(Work work) {
  return
      [permits = Computing::ofThisThread(), work = std::move(work)](auto&&... arguments) -> decltype(auto) {
        const Computing computing(permits);
        Computing::giveWay();
        return work(std::forward<decltype(arguments)>(arguments)...);
      };
}

/// Measures the time that a scope takes and adds it to a sum of seconds. The scope is also in the trace, if
/// one is written.
class StageTimer {
 public:
  /// `name`, `kind` and `numbers` are for the trace: see TraceScope.
  StageTimer(double& seconds, const char* name, TraceKind kind = TraceKind::kWork, TraceNumbers numbers = {})
      : trace_(name, kind, numbers), seconds_(seconds), start_(std::chrono::steady_clock::now()) {}
  ~StageTimer() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  const TraceScope trace_;
  double& seconds_;
  const std::chrono::steady_clock::time_point start_;
};

/// A StageTimer for a scope in which this thread waits for another one or for the disk. It gives the
/// thread's permit back meanwhile.
class WaitTimer {
 public:
  WaitTimer(double& seconds, const char* name) : timer_(seconds, name, TraceKind::kWait) {}

 private:
  const StageTimer timer_;
  const GivenBackPermit given_back_;
};

}  // namespace curvisplat
