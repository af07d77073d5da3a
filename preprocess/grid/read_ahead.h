// Reads the next values in threads of its own while the caller processes the current one: blocking reads stay off the TBB
// workers. Mostly one thread is enough. There is one value more than threads; values are reused and keep their capacity.
//
// Reading takes a permit, too, where the thread that makes it holds one (stream/base/compute_permits.h): much of it is decoding.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <limits>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "stream/base/compute_permits.h"
#include "stream/base/mutex.h"
#include "stream/base/threads.h"
#include "stream/base/trace.h"

namespace curvisplat {

template <typename T>
class ReadAhead {
 public:
  /// `fill` overwrites a value and returns true, or returns false at the end. It gives its permit back where it waits for other threads.
  explicit ReadAhead(std::function<bool(T&)> fill)
      : ReadAhead([fill = std::move(fill)](T& value, uint64_t) { return fill(value); }, 1) {}

  /// The same by `readers` threads, which call `fill` at the same time, with the numbers of the values: 0, 1, ...
  ReadAhead(std::function<bool(T&, uint64_t)> fill, unsigned readers)
      : fill_(std::move(fill)),
        permits_(Computing::ofThisThread()),
        values_(readers + 1),
        is_filled_(values_.size()) {
    try {
      while (threads_.size() < readers) threads_.emplace_back([this] { fillAll(); });
    } catch (const std::system_error&) {
      if (threads_.empty()) throw;  // fewer do, too
    }
  }

  ~ReadAhead() {
    {
      const MutexLock lock(mutex_);
      stopped_ = true;
    }
    changed_.notify_all();
    const GivenBackPermit given_back;
    for (std::thread& thread : threads_) thread.join();
  }

  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// Waits for the next value, valid until the next call; null at the end. Throws what `fill` threw. For one
  /// thread.
  T* next() {
    {
      const MutexLock lock(mutex_);
      given_back_ = taken_;
    }
    changed_.notify_all();
    return acquire();
  }

  /// Takes the next value, in place of next(), for callers that process several values at a time: it is valid
  /// until it is given back. Waits for ever where all values are taken. One thread at a time.
  T* acquire() {
    if (!isNextThere()) awaitNext();
    const MutexLock lock(mutex_);
    if (taken_ < end_) {
      const size_t place = taken_++ % values_.size();
      is_filled_[place] = false;
      return &values_[place];
    }
    if (error_) std::rethrow_exception(error_);
    return nullptr;
  }
  /// Gives back the value that was taken first of those not given back. Any thread.
  void giveBack() {
    const MutexLock lock(mutex_);
    ++given_back_;
    changed_.notify_all();
  }

 private:
  /// The value to be taken next, or the end.
  bool isThere() const REQUIRES(mutex_) { return is_filled_[taken_ % values_.size()] || taken_ >= end_; }
  bool isNextThere() {
    const MutexLock lock(mutex_);
    return isThere();
  }
  void awaitNext() {
    const GivenBackPermit given_back;
    const TraceScope trace("wait for reading", TraceKind::kWait);
    MutexLock lock(mutex_);
    while (!isThere()) changed_.wait(lock);
  }

  void fillAll() {
    nameThisThread("read-ahead");
    for (;;) {
      uint64_t number;
      {
        MutexLock lock(mutex_);
        while (!stopped_ && begun_ < end_ && begun_ >= given_back_ + values_.size()) changed_.wait(lock);
        if (stopped_ || begun_ >= end_) return;
        number = begun_++;
      }
      const size_t place = number % values_.size();
      bool more = false;
      std::exception_ptr error;
      try {
        const Computing computing(permits_, Urgency::kUrgent);
        const TraceScope trace("read ahead");
        more = fill_(values_[place], number);
      } catch (...) {
        error = std::current_exception();
      }
      const MutexLock lock(mutex_);
      if (more) {
        is_filled_[place] = true;
      } else if (number < end_) {
        end_ = number;
        error_ = error;
      }
      changed_.notify_all();
    }
  }

  const std::function<bool(T&, uint64_t)> fill_;
  ComputePermits* const permits_;
  std::vector<T> values_;
  Mutex mutex_;
  ConditionVariable changed_;
  std::vector<bool> is_filled_ GUARDED_BY(mutex_);  // by place
  // Numbers of values: to be filled next, back from the caller, to be given to it next.
  uint64_t begun_ GUARDED_BY(mutex_) = 0, given_back_ GUARDED_BY(mutex_) = 0, taken_ GUARDED_BY(mutex_) = 0;
  uint64_t end_ GUARDED_BY(mutex_) = std::numeric_limits<uint64_t>::max();  // the first that is not there
  bool stopped_ GUARDED_BY(mutex_) = false;
  std::exception_ptr error_ GUARDED_BY(mutex_);  // instead of value end_
  std::vector<std::thread> threads_;             // last, since they use the other members
};

}  // namespace curvisplat
