#include "stream/cache/cache_update.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <span>
#include <string>
#include <system_error>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/series.h"

namespace curvisplat {
namespace {

/// The path of the new manifest until it is complete, and of the old one until the folder is synced.
std::filesystem::path partOf(const std::filesystem::path& manifest) {
  std::filesystem::path part = manifest;
  part += ".part";
  return part;
}

void requireWhole(const std::filesystem::path& cache) {
  const std::filesystem::path absolute = std::filesystem::absolute(cache).lexically_normal();
  const std::filesystem::path whole = absolute.parent_path();
  std::error_code ignored;
  if (!absolute.filename().string().starts_with("blanks.") ||
      !std::filesystem::exists(whole / "manifest.json", ignored))
    return;
  for (size_t n = 0; n < readManifest(whole).own_blanks.size(); ++n)
    if (absolute.filename() == ownBlanksFolderName(n))
      throw Error("{}: is a part of {}, which would no longer open if this was changed; name that cache",
                  cache.string(), whole.string());
}

}  // namespace

CacheLock::CacheLock(const std::filesystem::path& cache) : cache_(cache), manifest_(cache / "manifest.json") {
  requireWhole(cache_);
  lock();
}

CacheLock::CacheLock(const CacheLock& whole, size_t set)
    : cache_(whole.cache() / ownBlanksFolderName(set)), manifest_(cache_ / "manifest.json") {
  lock();
}

void CacheLock::lock() {
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

void replaceManifest(const std::filesystem::path& cache, const Manifest& manifest) {
  const std::filesystem::path path = cache / "manifest.json";
  const std::filesystem::path part = partOf(path);
  SystemCalls::current().remove(part.c_str());  // which may be a link
  try {
    OutputFile file(part, Caching::kPages, OutputFile::Existing::kEmpty, path);
    const std::string text = manifest.toJson();
    file.append(std::as_bytes(std::span(text)));
    file.close();
    renameDurably(part, path);
  } catch (const NameNotSynced&) {
    throw;
  } catch (...) {
    removeFileIfThere(part);
    throw;
  }
}

void removeReplacedManifest(const std::filesystem::path& cache) {
  const std::filesystem::path part = partOf(cache / "manifest.json");
  // The program that replaces a manifest has locked the old one, which it may have to put back.
  const int fd = openRetrying(part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
  if (fd < 0) return;
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) SystemCalls::current().remove(part.c_str());
  SystemCalls::current().close(fd);
}

void addSources(const std::vector<std::string>& sources, Manifest& manifest) {
  for (const std::string& source : sources)
    if (std::find(manifest.sources.begin(), manifest.sources.end(), source) == manifest.sources.end())
      manifest.sources.push_back(source);
}

}  // namespace curvisplat
