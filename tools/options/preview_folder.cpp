#include "tools/options/preview_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLock = "lock";

fs::path newPath(const fs::path& place, const std::string& name) {
  static std::atomic<unsigned> made = 0;
  return place / fmt::format("{}.{}.{}", name, ::getpid(), made++);
}

bool isHeld(const fs::path& folder) {
  const int fd = ::open((folder / kLock).c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0) return errno != ENOENT;
  const bool held = ::flock(fd, LOCK_EX | LOCK_NB) != 0;
  ::close(fd);
  return held;
}

}  // namespace

PreviewFolder::PreviewFolder(const fs::path& place, const std::string& name) : path_(newPath(place, name)) {
  removeAll(path_);  // of a process of the same number that was killed
  makeFolder(path_);
  lock_ = ::open((path_ / kLock).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (lock_ < 0) {
    const std::string reason = std::generic_category().message(errno);
    removeAll(path_);
    throw Error("{}: cannot be created: {}", (path_ / kLock).string(), reason);
  }
  ::flock(lock_, LOCK_EX | LOCK_NB);  // a file system without locks has no left ones removed, either
}

PreviewFolder::~PreviewFolder() {
  if (!keep_) removeAll(path_);
  ::close(lock_);
}

void PreviewFolder::removeLeftOnes(const fs::path& place, const std::string& name) {
  std::vector<fs::path> left;
  std::error_code error;
  for (fs::directory_iterator at(place, error), end; !error && at != end; at.increment(error))
    if (at->path().filename().string().starts_with(name + ".") && !isHeld(at->path()))
      left.push_back(at->path());
  for (const fs::path& folder : left) removeAll(folder);
}

}  // namespace curvisplat
