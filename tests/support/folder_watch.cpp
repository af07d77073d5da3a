#include "tests/support/folder_watch.h"

#include <poll.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace curvisplat {
namespace {

constexpr int kLongestSilenceMs = 60'000;

}  // namespace

FolderWatch::FolderWatch(const std::filesystem::path& folder) : fd_(::inotify_init1(IN_CLOEXEC)) {
  if (fd_ < 0 || ::inotify_add_watch(fd_, folder.c_str(), IN_CREATE | IN_MODIFY | IN_MOVED_TO) < 0)
    throw std::system_error(errno, std::generic_category(), "inotify: " + folder.string());
}

FolderWatch::~FolderWatch() {
  ::close(fd_);
}

void FolderWatch::waitUntil(const std::function<bool()>& happened) {
  while (!happened()) {
    pollfd waiting{fd_, POLLIN, 0};
    if (::poll(&waiting, 1, kLongestSilenceMs) == 0)
      throw std::runtime_error("what was waited for did not happen");
    std::array<char, 4096> events;
    if (::read(fd_, events.data(), events.size()) < 0 && errno != EINTR)
      throw std::system_error(errno, std::generic_category(), "inotify");
  }
}

}  // namespace curvisplat
