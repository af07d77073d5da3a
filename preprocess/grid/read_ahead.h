// Reads the next value in a thread of its own while the caller processes the current one. Conversion's disk
// reads need no more concurrency, and blocking reads stay off the TBB workers. There are two values, which
// are reused and keep their capacity.
#pragma once

#include <pthread.h>

#include <array>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace curvisplat {

template <typename T>
class ReadAhead {
 public:
  /// `fill` runs in the reading thread: it overwrites a value and returns true, or returns false at the end.
  explicit ReadAhead(std::function<bool(T&)> fill) : fill_(std::move(fill)), thread_([this] { fillAll(); }) {}

  ~ReadAhead() {
    {
      const std::lock_guard lock(mutex_);
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
    std::unique_lock lock(mutex_);
    given_back_ = taken_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return filled_ > taken_ || ended_; });
    if (filled_ > taken_) return &values_[taken_++ % values_.size()];
    if (error_) std::rethrow_exception(error_);
    return nullptr;
  }

 private:
  void fillAll() {
    pthread_setname_np(pthread_self(), "read-ahead");
    for (;;) {
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return stopped_ || filled_ < given_back_ + values_.size(); });
        if (stopped_) return;
      }
      bool more = false;
      std::exception_ptr error;
      try {
        more = fill_(values_[filled_ % values_.size()]);
      } catch (...) {
        error = std::current_exception();
      }
      const std::lock_guard lock(mutex_);
      if (more) ++filled_;
      ended_ = !more;
      error_ = error;
      changed_.notify_all();
      if (ended_) return;
    }
  }

  std::function<bool(T&)> fill_;
  std::array<T, 2> values_;
  std::mutex mutex_;  // guards all members below; only the reading thread writes filled_
  std::condition_variable changed_;
  uint64_t filled_ = 0, taken_ = 0, given_back_ = 0;
  bool ended_ = false, stopped_ = false;
  std::exception_ptr error_;
  std::thread thread_;  // last, since it uses the other members
};

}  // namespace curvisplat
