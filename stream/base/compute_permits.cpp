#include "stream/base/compute_permits.h"

#include "stream/base/trace.h"

namespace curvisplat {
namespace {

thread_local Computing* this_thread = nullptr;

}  // namespace

/// A thread that is not urgent takes a permit only if more are free than urgent threads wait for.
bool ComputePermits::acquire(Urgency urgency, const Unneeded& unneeded) {
  MutexLock lock(mutex_);
  const bool is_urgent = urgency == Urgency::kUrgent;
  const auto isThere = [&](unsigned free) { return free > (is_urgent ? 0 : urgent_.load()); };
  if (!isThere(free_)) {
    const TraceScope trace("wait for a permit", TraceKind::kWait);
    urgent_ += is_urgent;
    bool gives_up = false;
    while (!isThere(free_) && !(gives_up = unneeded && unneeded()))
      (is_urgent ? for_urgent_ : for_others_).wait(lock);
    urgent_ -= is_urgent;
    if (gives_up) {
      wakeNext();  // who was not woken for this thread's sake
      return false;
    }
  }
  --free_;
  return true;
}

void ComputePermits::giveBack() {
  const MutexLock lock(mutex_);
  ++free_;
  wakeNext();
}

void ComputePermits::wakeNext() {
  if (free_ == 0) return;
  (free_ > urgent_ ? for_others_ : for_urgent_).notify_one();
}

void ComputePermits::recheck() {
  const MutexLock lock(mutex_);
  for_urgent_.notify_all();
  for_others_.notify_all();
}

Computing::Computing(ComputePermits* permits, Urgency urgency, const std::function<bool()>& unneeded)
    : urgency_(urgency) {
  if (!permits || this_thread) return;
  granted_ = permits->acquire(urgency, unneeded);
  if (!granted_) return;
  permits_ = permits;
  this_thread = this;
}

Computing::~Computing() {
  if (!permits_) return;
  this_thread = nullptr;
  permits_->giveBack();
}

ComputePermits* Computing::ofThisThread() {
  return this_thread ? this_thread->permits_ : nullptr;
}

void Computing::giveWay() {
  if (this_thread && this_thread->permits_->isWantedUrgently()) GivenBackPermit();
}

GivenBackPermit::GivenBackPermit() : of_(this_thread) {
  if (!of_) return;
  this_thread = nullptr;
  of_->permits_->giveBack();
}

GivenBackPermit::~GivenBackPermit() {
  if (!of_) return;
  of_->permits_->acquire(of_->urgency_);
  this_thread = of_;
}

}  // namespace curvisplat
