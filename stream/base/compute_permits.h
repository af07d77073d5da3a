// Bounds how many threads compute at a time, whoever started them: the workers of a frame, the painter's threads, and the
// thread that writes the last picture; or TBB's threads in a conversion, and those that read ahead of them. There are as many
// permits as `--threads` says. A thread holds one while it computes, and gives it back while it waits for another thread or for
// the disk:
//
//   Computing computing(permits);     // from here to the end of the scope, except
//   { WaitTimer waiting(...); ... }   // in here (stage_timer.h)
//   Computing::giveWay();             // and here, if a thread that is urgent waits for a permit
//
// No permit is idle while a thread waits for one. A thread with a permit waits for nothing that needs one, so there is no
// deadlock. Urgent threads come first: those that prepare splats, until the ring between them and the painter is full, and
// those that read, until all that they may read ahead is there. The other way round the painter runs dry, and then waits while
// one worker waits for the turn of another.
//
// Taking and giving back cost a mutex each (20 ns), so they surround bricks and batches, never splats.
#pragma once

#include <atomic>
#include <functional>
#include <utility>

#include "stream/base/mutex.h"

namespace curvisplat {

enum class Urgency { kNormal, kUrgent };

/// Thread-safe. Outlives whoever holds one of its permits.
class ComputePermits {
 public:
  explicit ComputePermits(unsigned count) : count_(count), free_(count) {}
  ComputePermits(const ComputePermits&) = delete;
  ComputePermits& operator=(const ComputePermits&) = delete;

  unsigned count() const { return count_; }
  /// What an `unneeded` (Computing) returns may have become true.
  void recheck();
  /// Whether an urgent thread waits for a permit.
  bool isWantedUrgently() const { return urgent_.load(std::memory_order_relaxed) > 0; }

 private:
  friend class Computing;
  friend class GivenBackPermit;

  using Unneeded = std::function<bool()>;
  bool take(Urgency urgency, const Unneeded& unneeded = {});
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
  /// Waits for a permit. Null: there is no bound. Does nothing if this thread holds a permit already.
  explicit Computing(ComputePermits* permits, Urgency urgency = Urgency::kNormal)
      : Computing(permits, urgency, {}) {}
  /// The same, but stops waiting when `unneeded` returns true, which it is asked each time that the thread wakes.
  Computing(ComputePermits* permits, Urgency urgency, const std::function<bool()>& unneeded);
  ~Computing();
  Computing(const Computing&) = delete;
  Computing& operator=(const Computing&) = delete;

  /// Those of which this thread holds one; null: it holds none.
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

/// This thread waits for something else in this scope, and its permit, if it has one, is another's meanwhile.
class GivenBackPermit {
 public:
  GivenBackPermit();
  ~GivenBackPermit();
  GivenBackPermit(const GivenBackPermit&) = delete;
  GivenBackPermit& operator=(const GivenBackPermit&) = delete;

 private:
  Computing* const of_;
};

/// `work` as a loop's threads are to call it: with a permit, where this thread, which begins the loop, holds one. Each call gives way
/// to urgent threads first.
template <typename Work>
auto withPermit(Work work) {
  return
      [permits = Computing::ofThisThread(), work = std::move(work)](auto&&... arguments) -> decltype(auto) {
        const Computing computing(permits);
        Computing::giveWay();
        return work(std::forward<decltype(arguments)>(arguments)...);
      };
}

}  // namespace curvisplat
