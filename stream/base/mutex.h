// A mutex whose users Clang checks: a member marked GUARDED_BY(mutex) is only touched, and a function
// marked REQUIRES(mutex) is only called, by code that holds the mutex. Clang reports anything else when it
// compiles (-Wthread-safety, in tools/check_clang.py); for other compilers the marks are empty. They have the names
// that Clang's documentation gives them.
//
// The analysis does not look into lambdas, so conditions are waited for in a loop:
//
//   MutexLock lock(mutex_);
//   while (waiting_.empty()) changed_.wait(lock);
#pragma once

#include <condition_variable>
#include <mutex>

#ifdef __clang__
#define CURVISPLAT_THREAD_ATTRIBUTE(x) __attribute__((x))
#else
#define CURVISPLAT_THREAD_ATTRIBUTE(x)
#endif

/// The member, or what the pointer points to, is touched only while `mutex` is held.
#define GUARDED_BY(mutex) CURVISPLAT_THREAD_ATTRIBUTE(guarded_by(mutex))
#define PT_GUARDED_BY(mutex) CURVISPLAT_THREAD_ATTRIBUTE(pt_guarded_by(mutex))
/// The function is called only with `mutex` held; only without it.
#define REQUIRES(mutex) CURVISPLAT_THREAD_ATTRIBUTE(requires_capability(mutex))
#define EXCLUDES(mutex) CURVISPLAT_THREAD_ATTRIBUTE(locks_excluded(mutex))

namespace curvisplat {

/// std::mutex, as Clang's analysis knows it. Locked by a MutexLock.
class CURVISPLAT_THREAD_ATTRIBUTE(capability("mutex")) Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

 private:
  friend class MutexLock;
  std::mutex mutex_;
};

/// Holds a mutex for a scope, except between unlock() and lock().
class CURVISPLAT_THREAD_ATTRIBUTE(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) CURVISPLAT_THREAD_ATTRIBUTE(acquire_capability(mutex))
      : lock_(mutex.mutex_) {}
  ~MutexLock() CURVISPLAT_THREAD_ATTRIBUTE(release_capability()) {}
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  void lock() CURVISPLAT_THREAD_ATTRIBUTE(acquire_capability()) { lock_.lock(); }
  void unlock() CURVISPLAT_THREAD_ATTRIBUTE(release_capability()) { lock_.unlock(); }

 private:
  friend class ConditionVariable;
  std::unique_lock<std::mutex> lock_;
};

/// std::condition_variable for a MutexLock.
class ConditionVariable {
 public:
  /// Gives the mutex up while it waits. Wakes without cause at times, so the caller checks its condition again.
  void wait(MutexLock& lock) { changed_.wait(lock.lock_); }
  void notify_one() { changed_.notify_one(); }
  void notify_all() { changed_.notify_all(); }

 private:
  std::condition_variable changed_;
};

}  // namespace curvisplat
