#include "stream/base/watched_file.h"

#include <sys/stat.h>

#include <utility>

#include "stream/base/error.h"

namespace curvisplat {

WatchedFile::WatchedFile(std::filesystem::path path) : path_(std::move(path)), opened_(stateOf(path_)) {}

WatchedFile::State WatchedFile::stateOf(const std::filesystem::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0 || !S_ISREG(found.st_mode)) return {};
  constexpr int64_t kNanoseconds = 1'000'000'000;
  return {found.st_dev, found.st_ino, static_cast<uint64_t>(found.st_size),
          kNanoseconds * found.st_mtim.tv_sec + found.st_mtim.tv_nsec};
}

bool WatchedFile::isSame() const {
  const State now = stateOf(path_);
  return now.bytes == opened_.bytes && now.changed_ns == opened_.changed_ns;
}

bool WatchedFile::isWhole() const {
  const State now = stateOf(path_);
  if (now == opened_ || now == State{}) return true;
  return isOpened(now) && now.bytes > opened_.bytes;
}

bool WatchedFile::isOpened(const State& now) const {
  return now.device == opened_.device && now.number == opened_.number;
}

void WatchedFile::requireWhole() const {
  const State now = stateOf(path_);
  if (isOpened(now) && now.bytes < opened_.bytes) failAsChanged();
}

void WatchedFile::failAsChanged() const {
  throw Error("{}: was changed while it was read; start again when it is complete", path_.string());
}

WatchedFiles::WatchedFiles(const std::vector<std::string>& names) : files_(names.begin(), names.end()) {}

void WatchedFiles::warn(std::vector<std::string>& warnings) const {
  for (const WatchedFile& file : files_)
    if (!file.isWhole())
      warnings.push_back(file.path().string() +
                         ": was changed while it was converted, and the cache may hold a part of what was "
                         "there before; convert it again when it is complete");
}

}  // namespace curvisplat
