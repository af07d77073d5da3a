// Runs long work for Python: without the interpreter's lock, with progress, and until Ctrl-C.
#pragma once

#include <pybind11/pybind11.h>

#include <functional>

#include "stream/base/progress.h"

namespace curvisplat::python {

/// Runs `work` in a thread of its own while this one, which must hold the interpreter's lock, waits without it and
/// looks for signals every 50 ms. `report`: None, or a callable that gets (phase, done, total, unit), at most twenty times a
/// second, in this thread. Throws what `work` throws, and Error where no thread can be started; after Ctrl-C, or if `report`
/// raises, stops the work and throws that Python exception.
/// Where the interpreter ends, the work is stopped first, and the end waits for it.
void runInterruptibly(const pybind11::object& report, const std::function<void(Progress&)>& work);

/// To be called where the interpreter begins to end, with its lock: stops all work and waits for it without the lock. A
/// thread that asked for the lock later would be ended by Python within a function of ours, which C++ takes for an error.
void endAllWork();

/// Called in the thread of work that Python stops, so that it need not wait for others.
void setInterruptHook(pybind11::object hook);

/// Work of the calling thread, as endAllWork() counts it.
class CountedWork {
 public:
  /// Throws Error after endAllWork(). `progress` may be null: it cannot be stopped.
  explicit CountedWork(Progress* progress);
  ~CountedWork();
  CountedWork(const CountedWork&) = delete;
  CountedWork& operator=(const CountedWork&) = delete;

 private:
  Progress* const progress_;
};

/// Gives up the interpreter's lock for as long as it lives, for work in the calling thread that takes long or waits for
/// threads that need the lock. Throws Error after endAllWork(), which waits for it.
class UnlockedWork {
  const CountedWork counted_{nullptr};  // first: the lock is there again when the work ends
  const pybind11::gil_scoped_release unlocked_;
};

}  // namespace curvisplat::python
