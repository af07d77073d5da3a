#include "stream/partial_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "stream/error.h"
#include "stream/file.h"
#include "stream/manifest.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLockName = "lock";

std::string reason() {
  return std::strerror(errno);
}

fs::path withSuffix(fs::path path, const char* suffix) {
  path += suffix;
  return path;
}

void removeFolder(const fs::path& path, const char* what) {
  std::error_code error;
  fs::remove_all(path, error);
  if (error) throw Error("{}: the {} cannot be removed: {}", path.string(), what, error.message());
}

}  // namespace

void checkReplaceable(const fs::path& target, bool overwrite) {
  if (target.empty()) throw UsageError("the output has no name");
  if (!fs::exists(fs::symlink_status(target))) return;
  if (!overwrite)
    throw Error("{}: exists already; choose another output, or allow overwriting (--overwrite)",
                target.string());
  try {
    const fs::path manifest = target / "manifest.json";
    Manifest::fromJson(readTextFile(manifest), manifest);
  } catch (const Error&) {
    throw Error(
        "{}: is not a whole splat cache and will not be overwritten; remove it, or choose another output",
        target.string());
  }
}

PartialFolder::PartialFolder(fs::path target, bool overwrite)
    // "cache/" has an empty file name; what is beside it belongs to "cache".
    : target_(target.has_filename() ? std::move(target) : target.parent_path()),
      path_(withSuffix(target_, ".partial")) {
  checkReplaceable(target_, overwrite);
  if (::mkdir(path_.c_str(), 0777) < 0 && errno != EEXIST)
    throw Error("{}: the folder cannot be made: {}; choose another output", path_.string(), reason());
  lock();
  try {
    // What a killed conversion left goes; the lock stays.
    for (const auto& entry : fs::directory_iterator(path_))
      if (entry.path().filename() != kLockName)
        removeFolder(entry.path(), "rest of an unfinished conversion");
  } catch (...) {
    ::close(lock_);
    throw;
  }
}

PartialFolder::~PartialFolder() {
  if (lock_ < 0) return;
  std::error_code ignored;
  fs::remove_all(path_, ignored);
  ::close(lock_);
}

void PartialFolder::lock() {
  const fs::path name = path_ / kLockName;
  const int fd = ::open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (fd < 0) throw Error("{}: cannot be opened: {}", name.string(), reason());
  const bool locked = ::flock(fd, LOCK_EX | LOCK_NB) == 0;
  const std::string why = reason();
  const bool busy = !locked && errno == EWOULDBLOCK;
  // A conversion that ended between open and flock has taken the file away: what is locked is not what is
  // here.
  struct stat ours {
  }, theirs{};
  const bool same = ::fstat(fd, &ours) == 0 && ::stat(name.c_str(), &theirs) == 0 &&
                    ours.st_ino == theirs.st_ino && ours.st_dev == theirs.st_dev;
  if (locked && same) {
    lock_ = fd;
    return;
  }
  ::close(fd);
  if (busy || locked)
    throw Error("{}: another conversion to this output is running; wait for it, or choose another output",
                path_.string());
  throw Error("{}: cannot be locked: {}", name.string(), why);
}

void PartialFolder::putIntoPlace() {
  CURVISPLAT_CHECK(lock_ >= 0);
  SystemCalls& calls = SystemCalls::current();
  syncDirectory(path_);
  if (!fs::exists(fs::symlink_status(target_))) {
    if (calls.rename(path_.c_str(), target_.c_str()) < 0)
      throw Error("{}: cannot be renamed to {}: {}", path_.string(), target_.string(), reason());
  } else if (calls.exchange(path_.c_str(), target_.c_str()) == 0) {
    removeFolder(path_, "old cache");
  } else if (errno == EINVAL || errno == ENOSYS || errno == ENOTSUP) {
    const fs::path aside = withSuffix(target_, ".replaced");
    if (calls.rename(target_.c_str(), aside.c_str()) < 0)
      throw Error("{}: cannot be moved aside to {}: {}", target_.string(), aside.string(), reason());
    if (calls.rename(path_.c_str(), target_.c_str()) < 0) {
      const std::string why = reason();
      calls.rename(aside.c_str(), target_.c_str());
      throw Error("{}: cannot be renamed to {}: {}", path_.string(), target_.string(), why);
    }
    removeFolder(aside, "old cache");
  } else {
    throw Error("{}: cannot be put in the place of {}: {}", path_.string(), target_.string(), reason());
  }
  // The lock goes after the renaming: gone before, another conversion could take the folder for a dead one's.
  const int lock = std::exchange(lock_, -1);
  std::error_code ignored;
  fs::remove(target_ / kLockName, ignored);
  ::close(lock);
  const fs::path parent = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
  syncDirectory(parent);
}

}  // namespace curvisplat
