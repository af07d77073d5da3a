#include "preprocess/formats/common/watched_file.h"

#include <sys/stat.h>

#include <utility>

#include "stream/base/error.h"

namespace curvisplat {

WatchedFile::WatchedFile(std::filesystem::path path) : path_(std::move(path)), opened_(stateOf(path_)) {}

WatchedFile::State WatchedFile::stateOf(const std::filesystem::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return {};
  constexpr int64_t kNanoseconds = 1'000'000'000;
  return {found.st_dev, found.st_ino, static_cast<uint64_t>(found.st_size),
          kNanoseconds * found.st_mtim.tv_sec + found.st_mtim.tv_nsec};
}

bool WatchedFile::isSame() const {
  const State now = stateOf(path_);
  return now.bytes == opened_.bytes && now.changed_ns == opened_.changed_ns;
}

void WatchedFile::requireWhole() const {
  const State now = stateOf(path_);
  if (now == opened_ || now.device != opened_.device || now.number != opened_.number) return;
  if (now.bytes <= opened_.bytes) failAsChanged();
}

void WatchedFile::failAsChanged() const {
  throw Error("{}: was changed while it was read; start again when it is complete", path_.string());
}

}  // namespace curvisplat
