// A build without inotify: looks from time to time.
#include <algorithm>
#include <thread>
#include <utility>

#include "tools/commands/folder_events.h"

namespace curvisplat {

FolderEvents::FolderEvents(std::vector<std::filesystem::path> folders) : folders_(std::move(folders)) {}
FolderEvents::~FolderEvents() = default;

void FolderEvents::wait(std::chrono::milliseconds longest, const Progress& progress) {
  constexpr std::chrono::milliseconds kPollInterval{250};
  std::this_thread::sleep_for(std::min(longest, kPollInterval));
  progress.throwIfStopped();
}

}  // namespace curvisplat
