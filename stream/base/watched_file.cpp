#include "stream/base/watched_file.h"

#include <sys/stat.h>

#include <map>
#include <system_error>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/mutex.h"

namespace curvisplat {

FileState FileState::of(const std::filesystem::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0 || !S_ISREG(found.st_mode)) return {};
  constexpr int64_t kNanoseconds = 1'000'000'000;
  return {found.st_dev, found.st_ino, static_cast<uint64_t>(found.st_size),
          kNanoseconds * found.st_mtim.tv_sec + found.st_mtim.tv_nsec};
}

WatchedFile::WatchedFile(std::filesystem::path path)
    : path_(std::move(path)), opened_(FileState::of(path_)) {}

bool WatchedFile::isSame() const {
  const FileState now = FileState::of(path_);
  return now.bytes == opened_.bytes && now.changed_ns == opened_.changed_ns;
}

bool WatchedFile::isWhole() const {
  const FileState now = FileState::of(path_);
  if (now == opened_ || now == FileState{}) return true;
  return isOpened(now) && now.bytes > opened_.bytes;
}

bool WatchedFile::isOpened(const FileState& now) const {
  return now.device == opened_.device && now.number == opened_.number;
}

void WatchedFile::requireWhole() const {
  const FileState now = FileState::of(path_);
  if (isOpened(now) && now.bytes < opened_.bytes) failAsChanged();
}

void WatchedFile::failAsChanged() const {
  throw Error("{}: was changed while it was read; start again when it is complete", path_.string());
}

namespace {

/// Files are known by their whole names, however they were given.
class Links {
 public:
  void add(const std::filesystem::path& from, std::set<std::filesystem::path> to) {
    const MutexLock lock(mutex);
    if (!to.empty()) links_[keyOf(from)].merge(to);
  }
  std::set<std::filesystem::path> of(const std::filesystem::path& file) const {
    const MutexLock lock(mutex);
    const auto found = links_.find(keyOf(file));
    return found == links_.end() ? std::set<std::filesystem::path>() : found->second;
  }

  mutable Mutex mutex;

 private:
  static std::filesystem::path keyOf(const std::filesystem::path& file) {
    std::error_code failed;
    const std::filesystem::path whole = std::filesystem::absolute(file, failed);
    return failed ? file : whole.lexically_normal();
  }

  std::map<std::filesystem::path, std::set<std::filesystem::path>> links_ GUARDED_BY(mutex);
};

Links& links() {
  static Links all;
  return all;
}

}  // namespace

void noteLinks(const std::filesystem::path& from, const std::set<std::filesystem::path>& to) {
  links().add(from, to);
}

std::set<std::filesystem::path> linkedFilesOf(const std::filesystem::path& from) {
  return links().of(from);
}

Mutex& linksMutex() {
  return links().mutex;
}

WatchedFiles::WatchedFiles(const std::vector<std::string>& names) {
  std::vector<std::filesystem::path> files(names.begin(), names.end());
  std::set<std::filesystem::path> known(files.begin(), files.end());
  for (size_t n = 0; n < files.size(); ++n) {
    files_.emplace_back(files[n]);
    for (const std::filesystem::path& next : linkedFilesOf(files[n]))
      if (known.insert(next).second) files.push_back(next);
  }
}

void WatchedFiles::requireSame() const {
  for (const WatchedFile& file : files_)
    if (!file.isSame()) file.failAsChanged();
}

void WatchedFiles::requireWhole() const {
  for (const WatchedFile& file : files_) file.requireWhole();
}

void WatchedFiles::warn(std::vector<std::string>& warnings) const {
  for (const WatchedFile& file : files_)
    if (!file.isWhole())
      warnings.push_back(file.path().string() +
                         ": was changed while it was converted, and the cache may hold a part of what was "
                         "there before; convert it again when it is complete");
}

}  // namespace curvisplat
