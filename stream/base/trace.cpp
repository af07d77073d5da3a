#include "stream/base/trace.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/mutex.h"
#include "stream/base/os.h"

namespace curvisplat {
namespace {

constexpr size_t kKeptEvents = 1024;
constexpr std::array kKindNames = {"stage", "work", "wait"};

struct Event {
  const char* name;
  TraceKind kind;
  TraceNumbers numbers;
  int64_t start_ns, wall_ns, processor_ns;
};

int64_t now(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return int64_t{1'000'000'000} * time.tv_sec + time.tv_nsec;
}

/// TBB's threads have no name of their own: they have the program's.
std::string nameOfThisThread() {
  if (os::isMainThread()) return "main";
  const std::string found = os::threadName();
  return found == "curvisplat" || found.empty() ? "tbb" : found;
}

std::string argumentsOf(const TraceNumbers& numbers) {
  if (numbers.number < 0) return {};
  if (numbers.splats < 0) return fmt::format(R"(,"args":{{"number":{}}})", numbers.number);
  return fmt::format(R"(,"args":{{"number":{},"splats":{}}})", numbers.number, numbers.splats);
}

/// The file of the trace that is written.
class TraceFile {
 public:
  TraceFile(const std::filesystem::path& path, unsigned process)
      : file_(path), process_(process), begun_ns_(now(CLOCK_MONOTONIC)) {
    append(fmt::format(R"([{{"name":"process_name","ph":"M","pid":{0},"args":{{"name":"rank {0}"}}}})",
                       process));
  }

  void name(int thread, const std::string& name) {
    append(
        fmt::format(",\n"
                    R"({{"name":"thread_name","ph":"M","pid":{},"tid":{},"args":{{"name":"{}"}}}})",
                    process_, thread, name));
  }

  void add(int thread, std::span<const Event> events) {
    std::string text;
    for (const Event& event : events)
      fmt::format_to(
          std::back_inserter(text),
          ",\n"
          R"({{"name":"{}","cat":"{}","ph":"X","pid":{},"tid":{},"ts":{:.3f},"dur":{:.3f},"tdur":{:.3f}{}}})",
          event.name, kKindNames[static_cast<size_t>(event.kind)], process_, thread,
          1e-3 * static_cast<double>(event.start_ns - begun_ns_), 1e-3 * static_cast<double>(event.wall_ns),
          1e-3 * static_cast<double>(event.processor_ns), argumentsOf(event.numbers));
    append(text);
  }

  void close() {
    append("\n]\n");
    if (!failure_) return file_.close();
    removeFileIfThere(file_.path());  // it has no end
    throw Error("{}", *failure_);
  }

 private:
  /// Appends to the file. After a failure work goes on, and close() reports it.
  void append(const std::string& text) {
    if (failure_) return;
    try {
      file_.append(std::span(text));
    } catch (const Error& error) {
      failure_ = error.what();
    }
  }

  OutputFile file_;
  const unsigned process_;
  const int64_t begun_ns_;
  std::optional<std::string> failure_;
};

class ThreadEvents;

/// All of the process. The locks are taken in this order: the registry's, a thread's.
struct TraceRegistry {
  Mutex mutex;
  std::unique_ptr<TraceFile> file GUARDED_BY(mutex);
  std::vector<ThreadEvents*> threads GUARDED_BY(mutex);
};

/// Never destroyed: threads that outlive main() still leave it.
TraceRegistry& registry() {
  static TraceRegistry& all = *new TraceRegistry;
  return all;
}

/// The events that a thread has kept.
class ThreadEvents {
 public:
  ThreadEvents() {
    TraceRegistry& all = registry();
    const MutexLock lock(all.mutex);
    all.threads.push_back(this);
  }
  ~ThreadEvents() {
    TraceRegistry& all = registry();
    const MutexLock lock(all.mutex);
    if (all.file) writeTo(*all.file);
    std::erase(all.threads, this);
  }
  ThreadEvents(const ThreadEvents&) = delete;
  ThreadEvents& operator=(const ThreadEvents&) = delete;

  void add(const Event& event) {
    {
      const MutexLock lock(mutex_);
      events_.push_back(event);
      if (events_.size() < kKeptEvents) return;
    }
    TraceRegistry& all = registry();
    const MutexLock lock(all.mutex);
    if (all.file) writeTo(*all.file);
  }

  void writeTo(TraceFile& file) {
    const MutexLock lock(mutex_);
    if (events_.empty()) return;
    if (!is_named_) file.name(thread_, name_);
    is_named_ = true;
    file.add(thread_, events_);
    events_.clear();
  }

  /// Forgets the events, for the next trace.
  void forget() {
    const MutexLock lock(mutex_);
    events_.clear();
    is_named_ = false;
  }

 private:
  const int thread_ = os::threadNumber();
  const std::string name_ = nameOfThisThread();
  Mutex mutex_;
  std::vector<Event> events_ GUARDED_BY(mutex_);
  bool is_named_ GUARDED_BY(mutex_) = false;
};

}  // namespace

void Trace::begin(const std::filesystem::path& path, unsigned process) {
  TraceRegistry& all = registry();
  const MutexLock lock(all.mutex);
  CURVISPLAT_CHECK(!all.file);
  all.file = std::make_unique<TraceFile>(path, process);
  for (ThreadEvents* const thread : all.threads) thread->forget();
  on_ = true;
}

void Trace::end() {
  TraceRegistry& all = registry();
  const MutexLock lock(all.mutex);
  if (!all.file) return;
  on_ = false;
  for (ThreadEvents* const thread : all.threads) thread->writeTo(*all.file);
  const std::unique_ptr<TraceFile> file = std::move(all.file);
  file->close();
}

void TraceScope::start() {
  wall_ns_ = now(CLOCK_MONOTONIC);
  processor_ns_ = now(CLOCK_THREAD_CPUTIME_ID);
}

void TraceScope::record() const {
  thread_local ThreadEvents own;
  own.add({name_, kind_, numbers_, wall_ns_, now(CLOCK_MONOTONIC) - wall_ns_,
           now(CLOCK_THREAD_CPUTIME_ID) - processor_ns_});
}

}  // namespace curvisplat
