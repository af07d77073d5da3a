#include "stream/cache/cache_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/open_retrying.h"
#include "stream/cache/replace_manifest.h"

namespace curvisplat {

CacheLock::CacheLock(const std::filesystem::path& cache) : cache_(cache), manifest_(cache / "manifest.json") {
  // Opened for writing because network file systems require that for an exclusive lock.
  fd_ = openRetrying(manifest_, O_RDWR);
  if (fd_ < 0)
    throw OutputError(
        "{}: cannot be opened for writing: {}; expected a complete splat cache with write permission",
        manifest_.string(), std::strerror(errno));
  if (::flock(fd_, LOCK_EX | LOCK_NB) == 0 && isStillThere()) {
    removeReplacedManifest(cache_);
    return;
  }
  const bool is_busy = errno == EWOULDBLOCK;
  const std::string reason = std::strerror(errno);
  const bool is_there = isStillThere();
  SystemCalls::current().close(fd_);
  if (is_busy || !is_there)
    throw OutputError("{}: another program is changing this cache; wait until it has finished",
                      cache_.string());
  throw OutputError("{}: cannot be locked: {}", manifest_.string(), reason);
}

CacheLock::~CacheLock() {
  SystemCalls::current().close(fd_);
}

bool CacheLock::isStillThere() const {
  struct stat ours {
  }, theirs{};
  return ::fstat(fd_, &ours) == 0 && ::stat(manifest_.c_str(), &theirs) == 0 &&
         ours.st_ino == theirs.st_ino && ours.st_dev == theirs.st_dev;
}

void CacheLock::requireStillThere() const {
  if (isStillThere()) return;
  throw OutputError(
      "{}: another program has replaced the cache; the new cache was not changed: add the step to it again",
      cache_.string());
}

}  // namespace curvisplat
