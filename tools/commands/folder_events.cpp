// folder_events_left_out.cpp stands in for this file where there is no inotify.
#include "tools/commands/folder_events.h"

#include <poll.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "stream/base/os.h"

namespace curvisplat {

using std::chrono::milliseconds;

namespace {

constexpr milliseconds kPollInterval{250};
// A signal may reach another thread, which does not end this one's poll().
constexpr milliseconds kSignalInterval{500};

/// Whether others can change the folder unseen by this machine's kernel.
bool isRemote(const std::filesystem::path& folder) {
  // These numbers are listed in statfs(2): AFS, CIFS, SMB, SMB2, NFS, 9P, FUSE, CEPH, LUSTRE, GPFS, OCFS2, GFS2.
  constexpr std::array<uint32_t, 12> kRemote{0x5346414f, 0xff534d42, 0x517b,     0xfe534d42,
                                             0x6969,     0x01021997, 0x65735546, 0x00c36400,
                                             0x0bd00bd0, 0x47504653, 0x7461636f, 0x01161970};
  const int64_t number = os::fileSystemNumber(folder.c_str());
  return number < 0 || std::find(kRemote.begin(), kRemote.end(), number) != kRemote.end();
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
  // IN_MODIFY is left out: a file that is being written may cause thousands.
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
