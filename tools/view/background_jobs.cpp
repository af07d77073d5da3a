#include "tools/view/background_jobs.h"

#include <fmt/format.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <chrono>
#include <csignal>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/base/os.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

constexpr int kNice = 10;  // the window and its picture come first

/// Returns what people see being done in a pass of a conversion, whose name is that of the code.
std::string wordsOf(const std::string& phase) {
  static const std::map<std::string, const char*> words{{"scan", "reading the grid"},
                                                        {"scan again", "reading the grid"},
                                                        {"sample", "reading the grid"},
                                                        {"count", "counting its nodes"},
                                                        {"drawn nodes", "comparing the nodes"},
                                                        {"merged nodes", "comparing the nodes"},
                                                        {"scatter", "making splats"},
                                                        {"seams", "joining blocks"},
                                                        {"build", "writing splats"},
                                                        {"faces", "writing faces"},
                                                        {"check", "checking what is there"},
                                                        {"finish", "finishing"}};
  const auto found = words.find(phase);
  return found == words.end() ? phase : found->second;
}

/// Calls it at the end of its lifetime.
struct WakeAtEnd {
  void (*call)();
  ~WakeAtEnd() { call(); }
};

/// Threads of low priority for work that the window goes on beside.
///
/// TBB has one set of threads for the whole program, and they draw the pictures. Linux lets an ordinary user
/// lower a thread's priority, but not raise it again: a thread that converted at low priority would draw at
/// low priority ever after, and one of normal priority takes the cores from the window. So background work
/// has threads of its own, and its loops run in an arena that TBB's threads do not enter.
class BackgroundThreads {
 public:
  /// Starts one thread fewer than the machine has cores: the thread that calls run() is the last one.
  /// `nice`: as nice(1), 0 to 19.
  explicit BackgroundThreads(int nice);
  /// Ends the threads. run() must have returned.
  ~BackgroundThreads();
  BackgroundThreads(const BackgroundThreads&) = delete;
  BackgroundThreads& operator=(const BackgroundThreads&) = delete;

  /// Does `work` in the calling thread, which has this priority from now on, and its parallel loops in all
  /// of these threads. Throws what `work` throws.
  void run(const std::function<void()>& work);

 private:
  void end();

  const int nice_;
  tbb::task_arena arena_;
  std::deque<tbb::task_group> ends_;       // what each thread waits for, doing the arena's work meanwhile
  std::vector<tbb::task_handle> keeping_;  // the tasks of these groups, which nobody runs
  std::vector<std::thread> threads_;
};

// All places are reserved for threads that call execute(), so that none is left for TBB's own.
BackgroundThreads::BackgroundThreads(int nice)
    : nice_(nice),
      arena_(tbb::info::default_concurrency(), static_cast<unsigned>(tbb::info::default_concurrency())) {
  arena_.initialize();
  const auto count = static_cast<size_t>(tbb::info::default_concurrency() - 1);
  for (size_t n = 0; n < count; ++n) keeping_.push_back(ends_.emplace_back().defer([] {}));
  try {
    for (tbb::task_group& its_end : ends_)
      threads_.emplace_back([this, &its_end] {
        nameThisThread("background");
        os::lowerThreadPriority(nice_);
        arena_.execute([&its_end] { its_end.wait(); });
      });
  } catch (...) {  // there is no thread to be had
    end();
    throw;
  }
}

BackgroundThreads::~BackgroundThreads() {
  end();
}

void BackgroundThreads::end() {
  keeping_.clear();
  for (std::thread& thread : threads_) thread.join();
  for (tbb::task_group& its_end : ends_) its_end.wait();  // that no thread has waited for
}

void BackgroundThreads::run(const std::function<void()>& work) {
  os::lowerThreadPriority(nice_);
  arena_.execute(work);
}

}  // namespace

BackgroundJob::BackgroundJob(std::string title, std::string phase, Work work, void (*wake)())
    : title_(std::move(title)),
      phase_(std::move(phase)),
      progress_([this, wake](const Progress::State* state) {
        if (!state) return;
        {
          const MutexLock lock(mutex_);
          const uint64_t done = state->done + state->skipped;
          // Neither bytes nor splats are counted.
          const bool counts = state->unit == kPicturesUnit && state->total > 1;
          phase_ = wordsOf(state->phase) + (counts ? fmt::format(", {} of {}", done, state->total) : "");
          part_ = state->total > 0 ? static_cast<float>(done) / static_cast<float>(state->total) : 0;
        }
        wake();
      }) {
  made_ = std::async(std::launch::async, [this, wake, work = std::move(work)] {
    nameThisThread("job");
    const WakeAtEnd at_the_end{wake};
    BackgroundThreads threads(kNice);
    std::filesystem::path made;
    threads.run([&] { made = work(progress_); });
    return made;
  });
}

BackgroundJob::~BackgroundJob() {
  progress_.stop(SIGTERM);
  if (made_.valid()) made_.wait();
}

std::string BackgroundJob::phase() const {
  const MutexLock lock(mutex_);
  return phase_;
}

float BackgroundJob::part() const {
  const MutexLock lock(mutex_);
  return part_;
}

bool BackgroundJob::isDone() const {
  return made_.valid() && made_.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

Opening::Opening(std::string title, Work work, void (*wake)())
    : job_(
          std::move(title), "reading",
          [this, wake, work = std::move(work)](Progress& progress) {
            OpeningEvents events;
            events.say = [this](const std::string& text) {
              const MutexLock lock(mutex_);
              messages_.push_back(text);
            };
            events.preview = [this, wake](Preview preview) {
              {
                const MutexLock lock(mutex_);
                preview_ = std::move(preview);
              }
              wake();
            };
            return work(progress, events);
          },
          wake) {}

std::vector<std::string> Opening::takeMessages() {
  const MutexLock lock(mutex_);
  return std::exchange(messages_, {});
}

std::optional<Preview> Opening::takePreview() {
  const MutexLock lock(mutex_);
  return std::exchange(preview_, std::nullopt);
}

namespace {

/// Results of the threads of lists that were destroyed, which nobody asks for.
struct LeftThreads {
  Mutex mutex;
  std::vector<std::future<std::vector<SourceScalar>>> found GUARDED_BY(mutex);
};
LeftThreads& leftThreads() {
  static LeftThreads left;
  return left;
}

bool isReady(const std::future<std::vector<SourceScalar>>& found) {
  return found.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

}  // namespace

FurtherScalarList::FurtherScalarList(const ConversionServices& services, std::filesystem::path cache,
                                     std::vector<std::filesystem::path> files, void (*wake)())
    : services_(services), cache_(std::move(cache)), files_(std::move(files)), wake_(wake) {
  for (const std::filesystem::path& file : files_) {
    if (!known_.from.empty()) known_.from += ' ';
    known_.from += file.filename().string();
  }
}

FurtherScalarList::~FurtherScalarList() {
  LeftThreads& left = leftThreads();
  const MutexLock lock(left.mutex);
  std::erase_if(left.found, isReady);
  if (found_.valid() && !isReady(found_)) left.found.push_back(std::move(found_));
}

void FurtherScalarList::waitForThreads() {
  LeftThreads& left = leftThreads();
  const MutexLock lock(left.mutex);
  left.found.clear();
}

void FurtherScalarList::look() {
  if (files_.empty() || std::exchange(asked_, true)) return;
  known_.is_looking = true;
  // The thread has its own copies, since it can outlive the list.
  found_ = std::async(std::launch::async,
                      [look = services_.further_scalars, cache = cache_, files = files_, wake = wake_] {
                        nameThisThread("scalars");
                        const WakeAtEnd at_the_end{wake};
                        return look(cache, files);
                      });
}

const FurtherScalars& FurtherScalarList::known() {
  if (!found_.valid() || !isReady(found_)) return known_;
  known_.is_looking = false;
  try {
    known_.scalars = found_.get();
  } catch (const std::exception& error) {
    known_.error = error.what();
  }
  return known_;
}

}  // namespace curvisplat
