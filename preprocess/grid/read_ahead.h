// Reads the next value in a thread of its own while the caller processes the current one. Conversion's disk
// reads need no more concurrency, and blocking reads stay off the TBB workers. There are two values, which
// are reused and keep their capacity.
#pragma once

#include <array>
#include <cstdint>
#include <exception>
#include <functional>
#include <thread>
#include <utility>

#include "stream/base/mutex.h"
#include "stream/base/thread_name.h"
#include "stream/base/trace.h"

namespace curvisplat {

template <typename T>
class ReadAhead {
 public:
  /// `fill` runs in the reading thread: it overwrites a value and returns true, or returns false at the end.
  explicit ReadAhead(std::function<bool(T&)> fill) : fill_(std::move(fill)), thread_([this] { fillAll(); }) {}

  ~ReadAhead() {
    {
      const MutexLock lock(mutex_);
      stopped_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }

  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// Waits for the next value, valid until the next call; null at the end. Throws what `fill` threw. For one
  /// thread.
  T* next() {
    MutexLock lock(mutex_);
    given_back_ = taken_;
    changed_.notify_all();
    {
      const TraceScope trace("wait for reading", TraceKind::kWait);
      while (filled_ <= taken_ && !ended_) changed_.wait(lock);
    }
    if (filled_ > taken_) return &values_[taken_++ % values_.size()];
    if (error_) std::rethrow_exception(error_);
    return nullptr;
  }

 private:
  void fillAll() {
    nameThisThread("read-ahead");
    for (uint64_t filled = 0;; ++filled) {
      {
        MutexLock lock(mutex_);
        while (!stopped_ && filled >= given_back_ + values_.size()) changed_.wait(lock);
        if (stopped_) return;
      }
      bool more = false;
      std::exception_ptr error;
      try {
        const TraceScope trace("read ahead");
        more = fill_(values_[filled % values_.size()]);
      } catch (...) {
        error = std::current_exception();
      }
      const MutexLock lock(mutex_);
      if (more) ++filled_;
      ended_ = !more;
      error_ = error;
      changed_.notify_all();
      if (ended_) return;
    }
  }

  std::function<bool(T&)> fill_;
  std::array<T, 2> values_;
  Mutex mutex_;
  ConditionVariable changed_;
  uint64_t filled_ GUARDED_BY(mutex_) = 0, taken_ GUARDED_BY(mutex_) = 0, given_back_ GUARDED_BY(mutex_) = 0;
  bool ended_ GUARDED_BY(mutex_) = false, stopped_ GUARDED_BY(mutex_) = false;
  std::exception_ptr error_ GUARDED_BY(mutex_);
  std::thread thread_;  // last, since it uses the other members
};

}  // namespace curvisplat
