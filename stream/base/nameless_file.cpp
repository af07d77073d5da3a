#include "stream/base/nameless_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <list>
#include <utility>

#include "stream/base/disk_full.h"
#include "stream/base/mutex.h"
#include "stream/base/new_file.h"
#include "stream/base/paths.h"

namespace curvisplat {
namespace {

/// A file of this process's own, which nobody else can read or, in a folder like /tmp, replace.
OutputFile create(const std::filesystem::path& folder) {
  const NewFile file = createNewFile(
      [&](uint32_t random) { return folder / fmt::format("curvisplat.{:08x}.tmp", random); }, 0600);
  if (file.fd < 0) {
    const int error = errno;
    if (DiskFull::is(error)) throw DiskFull(folder, folder, "a temporary file", error);
    throw Error("{}: no temporary file can be made there: {}", folder.string(), std::strerror(error));
  }
  try {
    OutputFile out(file.path, Caching::kPages, OutputFile::Existing::kKeep, folderOf(file.path));
    SystemCalls::current().close(file.fd);
    return out;
  } catch (...) {
    SystemCalls::current().close(file.fd);
    removeAll(file.path);
    throw;
  }
}

InputFile openWithoutName(const std::filesystem::path& path) {
  try {
    InputFile in(path);
    removeFile(path);
    return in;
  } catch (...) {
    removeAll(path);
    throw;
  }
}

}  // namespace

struct ScratchFiles::State {
  mutable Mutex mutex;
  std::list<std::function<uint64_t()>> files GUARDED_BY(mutex);
  mutable uint64_t most GUARDED_BY(mutex) = 0;

  /// Files only grow, so they take the most before one of them goes.
  void measure() const REQUIRES(mutex) {
    uint64_t bytes = 0;
    for (const auto& bytes_of : files) bytes += bytes_of();
    most = std::max(most, bytes);
  }
};

ScratchFiles::ScratchFiles(std::filesystem::path folder)
    : folder_(std::move(folder)), state_(std::make_shared<State>()) {}

std::shared_ptr<void> ScratchFiles::countBeside(std::function<uint64_t()> bytes) const {
  const MutexLock lock(state_->mutex);
  const auto file = state_->files.insert(state_->files.end(), std::move(bytes));
  return {nullptr, [state = state_, file](void*) {
            const MutexLock ending(state->mutex);
            state->measure();
            state->files.erase(file);
          }};
}

uint64_t ScratchFiles::mostBytes() const {
  const MutexLock lock(state_->mutex);
  state_->measure();
  return state_->most;
}

NamelessFile::NamelessFile(const ScratchFiles& scratch)
    : out_(create(scratch.folder())),
      in_(openWithoutName(out_.path())),
      counted_(scratch.countBeside([this] { return out_.size(); })) {}

}  // namespace curvisplat
