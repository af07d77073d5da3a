#include "tools/python/interruptible.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <exception>
#include <future>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/mutex.h"
#include "tools/output/start_checks.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

constexpr std::chrono::milliseconds kPause{50};

/// The newest state of the work, from its threads to Python's.
class LatestState {
 public:
  void set(const Progress::State* state) {
    const MutexLock lock(mutex_);
    state_ = state ? std::optional(*state) : std::nullopt;
  }
  std::optional<Progress::State> take() {
    const MutexLock lock(mutex_);
    return std::exchange(state_, std::nullopt);
  }

 private:
  Mutex mutex_;
  std::optional<Progress::State> state_ GUARDED_BY(mutex_);
};

/// The work that runs in all threads of this process.
class AllWork {
 public:
  void add(Progress* progress) {
    const MutexLock lock(mutex_);
    if (ending_) throw Error("the interpreter is ending");
    // A process that was forked has none of its parent's threads.
    if (std::exchange(process_, ::getpid()) != ::getpid()) running_.clear();
    running_.push_back(progress);
  }
  void remove(Progress* progress) {
    const MutexLock lock(mutex_);
    const auto found = std::find(running_.begin(), running_.end(), progress);
    if (found != running_.end()) running_.erase(found);
    ended_.notify_all();
  }
  void end() {
    MutexLock lock(mutex_);
    ending_ = true;
    if (process_ != ::getpid()) return;
    for (Progress* const progress : running_)
      if (progress) progress->stop(SIGTERM);
    while (!running_.empty()) ended_.wait(lock);
  }

 private:
  Mutex mutex_;
  ConditionVariable ended_;
  pid_t process_ GUARDED_BY(mutex_) = 0;
  bool ending_ GUARDED_BY(mutex_) = false;
  std::vector<Progress*> running_ GUARDED_BY(mutex_);
};

/// Never destroyed: daemon threads may outlive static objects.
AllWork& allWork() {
  static AllWork& all = *new AllWork;
  return all;
}

/// Lets Python handle its signals and shows it the progress. Throws what that raises.
void visitPython(const py::object& report, LatestState& latest) {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  if (report.is_none()) return;
  if (const auto state = latest.take())
    report(state->phase, state->done + state->skipped, state->total, state->unit);
}

/// Never destroyed: the interpreter may have ended before static objects are.
py::object& interruptHook() {
  static py::object& hook = *new py::object;
  return hook;
}

void callInterruptHook() {
  const py::object hook = interruptHook();  // which another thread may replace
  if (!hook) return;
  try {
    hook();
  } catch (py::error_already_set&) {
    // What has stopped the work is reported.
  }
}

void run(const py::object& report, const std::function<void(Progress&)>& work) {
  LatestState latest;
  Progress progress([&](const Progress::State* state) { latest.set(state); });
  const CountedWork counted(&progress);
  std::future<void> done = std::async(std::launch::async, [&] { work(progress); });
  std::optional<py::error_already_set> raised;
  while (true) {
    std::future_status status;
    {
      const py::gil_scoped_release unlocked;
      status = done.wait_for(kPause);
    }
    if (status == std::future_status::ready) break;
    if (raised) continue;
    try {
      visitPython(report, latest);
    } catch (py::error_already_set& error) {
      raised.emplace(error);
      callInterruptHook();
      progress.stop(SIGINT);
    }
  }
  try {
    done.get();
  } catch (const std::exception&) {
    if (!raised) throw;  // else it was stopped
  }
  if (raised) throw *raised;
}

}  // namespace

CountedWork::CountedWork(Progress* progress) : progress_(progress) {
  allWork().add(progress);
}

CountedWork::~CountedWork() {
  allWork().remove(progress_);
}

void setInterruptHook(py::object hook) {
  interruptHook() = std::move(hook);
}

void endAllWork() {
  const py::gil_scoped_release unlocked;
  allWork().end();
}

void runInterruptibly(const py::object& report, const std::function<void(Progress&)>& work) {
  if (!report.is_none() && PyCallable_Check(report.ptr()) == 0)
    throw UsageError("progress: {} is not callable",
                     std::string(py::str(report.get_type().attr("__name__"))));
  try {
    run(report, work);
  } catch (const std::exception& error) {
    // Others may have taken the threads that there were.
    if (isForLackOfThreads(error)) throw Error(kNoThread);
    throw;
  }
}

}  // namespace curvisplat::python
