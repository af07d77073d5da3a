#include "tools/python/interruptible.h"

#include <chrono>
#include <csignal>
#include <future>
#include <optional>
#include <string>

#include "stream/base/mutex.h"

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

/// Lets Python handle its signals and shows it the progress. Throws what that raises.
void visitPython(const py::object& report, LatestState& latest) {
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  if (report.is_none()) return;
  if (const auto state = latest.take())
    report(state->phase, state->done + state->skipped, state->total, state->unit);
}

}  // namespace

void runInterruptibly(const py::object& report, const std::function<void(Progress&)>& work) {
  LatestState latest;
  Progress progress([&](const Progress::State* state) { latest.set(state); });
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
      progress.stop(SIGINT);
    }
  }
  try {
    done.get();
  } catch (const Interrupted&) {
    if (!raised) throw;
  }
  if (raised) throw *raised;
}

}  // namespace curvisplat::python
