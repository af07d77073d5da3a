#include "tools/commands/written_files.h"

#include <poll.h>
#include <sys/inotify.h>
#include <sys/vfs.h>
#include <unistd.h>

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
    std::error_code error, no_size;
    const auto written = fs::last_write_time(path, error);
    const auto bytes = fs::file_size(path, no_size);
    if (error) return kSettled;
    Seen& seen = seen_.try_emplace(path, Seen{written, bytes, now}).first->second;
    if (seen.written != written || seen.bytes != bytes) seen = {written, bytes, now};
    longest = std::max(longest, std::chrono::ceil<milliseconds>(kSettled - (now - seen.since)));
  }
  return longest;
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
  until_next_ = untilSettled(steps.front());
  // Those behind it are watched from now on, and need not be waited for one by one.
  for (size_t n = 1; n < std::min(kWatchedAhead, steps.size()); ++n) untilSettled(steps[n]);
  if (until_next_.count() > 0) return std::nullopt;
  done_.insert(steps.front().name);
  return steps.front();
}

namespace {

constexpr milliseconds kPollInterval{250};
// A signal may reach another thread, which does not end this one's poll().
constexpr milliseconds kSignalInterval{500};

/// Whether others can change the folder unseen by this machine's kernel.
bool isRemote(const std::filesystem::path& folder) {
  // As statfs(2) lists them: AFS, CIFS, SMB, SMB2, NFS, 9P, FUSE, CEPH, LUSTRE, GPFS, OCFS2, GFS2.
  constexpr std::array<uint32_t, 12> kRemote{0x5346414f, 0xff534d42, 0x517b,     0xfe534d42,
                                             0x6969,     0x01021997, 0x65735546, 0x00c36400,
                                             0x0bd00bd0, 0x47504653, 0x7461636f, 0x01161970};
  struct statfs system {};
  if (::statfs(folder.c_str(), &system) < 0) return true;
  return std::find(kRemote.begin(), kRemote.end(), static_cast<uint32_t>(system.f_type)) != kRemote.end();
}

}  // namespace

FolderEvents::FolderEvents(std::vector<std::filesystem::path> folders) : folders_(std::move(folders)) {
  watch();
}

FolderEvents::~FolderEvents() {
  close();
}

void FolderEvents::close() {
  if (queue_ >= 0) ::close(queue_);
  queue_ = -1;
}

/// All of the folders, or none.
void FolderEvents::watch() {
  // Not IN_MODIFY: of a file that is being written there may be thousands.
  constexpr uint32_t kChanges =
      IN_CREATE | IN_CLOSE_WRITE | IN_MOVED_TO | IN_ONLYDIR | IN_DELETE_SELF | IN_MOVE_SELF;
  if (std::any_of(folders_.begin(), folders_.end(), isRemote)) return;
  queue_ = ::inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  for (const auto& folder : folders_)
    if (queue_ >= 0 && ::inotify_add_watch(queue_, folder.c_str(), kChanges) < 0) close();
}

void FolderEvents::wait(milliseconds longest, const Progress& progress) {
  const auto end = std::chrono::steady_clock::now() + longest;
  if (queue_ < 0) {
    watch();  // the folder may be there by now
    // What was written before the watch began is looked at at once.
    if (queue_ < 0) ::poll(nullptr, 0, static_cast<int>(std::min(longest, kPollInterval).count()));
    return progress.throwIfStopped();
  }
  while (true) {
    progress.throwIfStopped();
    const auto left =
        std::chrono::duration_cast<milliseconds>(end - std::chrono::steady_clock::now()) + milliseconds(1);
    if (left.count() <= 0) return;
    pollfd queue{queue_, POLLIN, 0};
    if (::poll(&queue, 1, static_cast<int>(std::min(left, kSignalInterval).count())) > 0) break;
  }
  std::array<char, 4096> events;
  bool has_lost_a_folder = false;
  for (ssize_t bytes = 0; (bytes = ::read(queue_, events.data(), events.size())) > 0;)
    for (ssize_t at = 0; at < bytes;) {
      inotify_event event;
      std::copy_n(events.data() + at, sizeof event, reinterpret_cast<char*>(&event));
      has_lost_a_folder |= (event.mask & (IN_DELETE_SELF | IN_MOVE_SELF | IN_IGNORED)) != 0;
      at += static_cast<ssize_t>(sizeof event + event.len);
    }
  if (has_lost_a_folder) close();
}

}  // namespace curvisplat
