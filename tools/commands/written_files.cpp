#include "tools/commands/written_files.h"

#include <algorithm>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/paths.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

// A file that has not changed for this long has been written.
constexpr milliseconds kSettled{2000};
// If no change is reported for so long, look whether one was missed.
constexpr milliseconds kLongestWait{30'000};

std::vector<fs::path> filesOf(const OpenGridOptions& options) {
  std::vector<fs::path> files = options.solutions;
  files.push_back(options.grid);
  return files;
}

/// Until no file of the step has changed for a while; 0 or less where that is so.
milliseconds untilSettled(const OpenGridOptions& options) {
  milliseconds longest{0};
  for (const fs::path& path : filesOf(options)) {
    std::error_code error;
    const auto written = fs::last_write_time(path, error);
    if (error) return kSettled;
    const auto age = fs::file_time_type::clock::now() - written;
    longest = std::max(longest, std::chrono::ceil<milliseconds>(kSettled - age));
  }
  return longest;
}

}  // namespace

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
  for (const StepFiles& step : steps) {
    if (done_.contains(step.name)) continue;
    const milliseconds until = untilSettled(step.options);
    if (until.count() > 0) {
      // A clock that is ahead of the file system's must not make it wait for ever.
      until_next_ = std::min(until, kSettled);
      return std::nullopt;
    }
    done_.insert(step.name);
    return step;
  }
  return std::nullopt;
}

}  // namespace curvisplat
