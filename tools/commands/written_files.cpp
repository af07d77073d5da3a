#include "tools/commands/written_files.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

// A file that has not changed for this long has been written.
constexpr milliseconds kSettled{2000};
// The time without a report of changes after which files are looked at, in case one was missed.
constexpr milliseconds kLongestWait{30'000};
constexpr size_t kWatchedAhead = 64;  // steps

std::vector<fs::path> filesOf(const OpenGridOptions& options) {
  std::vector<fs::path> files = options.solutions;
  files.push_back(options.grid);
  return files;
}

}  // namespace

milliseconds WrittenFiles::untilSettled(const StepFiles& step) {
  milliseconds longest{0};
  const auto now = std::chrono::steady_clock::now();
  for (const fs::path& path : filesOf(step.options)) {
    std::error_code error;
    const auto written = fs::last_write_time(path, error);
    if (error) {
      try {
        isThere(path);
      } catch (const Error& reason) {
        if (told_.insert(reason.what()).second) reasons_.push_back(reason.what());
      }
      return kSettled;
    }
    const FileState state = FileState::of(path);
    Seen& seen = seen_.try_emplace(path, Seen{state, written, now}).first->second;
    if (seen.written != written || seen.state != state) seen = {state, written, now};
    longest = std::max(longest, std::chrono::ceil<milliseconds>(kSettled - (now - seen.since)));
  }
  return longest;
}

void WrittenFiles::tryAgain(const StepFiles& step) {
  done_.erase(step.name);
  failed_ = {step.name, std::chrono::steady_clock::now()};
}

bool WrittenFiles::hasFailedAsItIs(const StepFiles& step) const {
  if (!failed_ || failed_->step != step.name) return false;
  return std::ranges::none_of(filesOf(step.options), [&](const fs::path& path) {
    const auto seen = seen_.find(path);
    return seen != seen_.end() && seen->second.since > failed_->at;
  });
}

std::vector<fs::path> foldersOf(const OpenGridOptions& options) {
  std::vector<fs::path> folders;
  for (const fs::path& file : filesOf(options)) {
    fs::path folder = folderOf(file);
    if (std::find(folders.begin(), folders.end(), folder) == folders.end())
      folders.push_back(std::move(folder));
  }
  return folders;
}

void WrittenFiles::markDone(const std::vector<std::string>& files, bool but_the_last) {
  done_.insert(files.begin(), files.end());
  begins_at_last_ = but_the_last;
}

std::optional<StepFiles> WrittenFiles::next() {
  until_next_ = kLongestWait;
  std::vector<StepFiles> steps;
  try {
    OpenGridOptions files = options_;
    expandPatterns(files);
    steps = stepsByName(files);
  } catch (const Error&) {
    return std::nullopt;  // none has been written yet, or not every kind of file
  }
  if (std::exchange(begins_at_last_, false)) {
    const auto last = std::find_if(steps.rbegin(), steps.rend(),
                                   [&](const StepFiles& step) { return done_.contains(step.name); });
    if (last != steps.rend()) done_.erase(last->name);
  }
  std::erase_if(steps, [&](const StepFiles& step) { return done_.contains(step.name); });
  if (steps.empty()) return std::nullopt;
  is_last_ = steps.size() == 1;
  until_next_ = untilSettled(steps.front());
  // Those behind it are watched from now on, and need not be waited for one by one.
  milliseconds behind = kLongestWait;
  for (size_t n = std::min(kWatchedAhead, steps.size()); --n > 0;) behind = untilSettled(steps[n]);
  if (hasFailedAsItIs(steps.front())) until_next_ = behind;
  if (until_next_.count() > 0) return std::nullopt;
  done_.insert(steps.front().name);
  return steps.front();
}

}  // namespace curvisplat
