#include "stream/base/temporary_files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <list>
#include <random>
#include <span>
#include <utility>

#include "stream/base/checksum.h"
#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/mutex.h"

namespace curvisplat {

NewFile createNewFile(const std::function<std::filesystem::path(uint32_t random)>& name, unsigned mode) {
  std::random_device random;
  while (true) {
    NewFile file{name(random()), -1};
    file.fd = openRetrying(file.path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW, mode);
    if (file.fd >= 0 || errno != EEXIST) return file;
  }
}

namespace {

constexpr size_t kMachineDigits = 8, kRandomDigits = 8;

std::string machineDigits() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  const std::string_view host(name.data());
  return fmt::format("{:016x}", checksumOf(std::as_bytes(std::span(host)))).substr(0, kMachineDigits);
}

}  // namespace

std::string TemporaryNames::of(uint32_t random) const {
  return fmt::format("{}{}{:08x}{}", begin, machineDigits(), random, end);
}

bool TemporaryNames::areOfThisMachine(std::string_view name) const {
  return name.size() == begin.size() + kMachineDigits + kRandomDigits + end.size() &&
         name.starts_with(std::string(begin) + machineDigits()) && name.ends_with(end);
}

bool lockNew(int fd) {
  const bool busy = ::flock(fd, LOCK_EX | LOCK_NB) < 0 && errno == EWOULDBLOCK;
  if (busy) return false;
  struct stat status {};
  // If it cannot be examined, the next call on it or its name fails with a reason; another file would be no
  // better.
  return ::fstat(fd, &status) < 0 || status.st_nlink > 0;
}

void removeAbandoned(const std::filesystem::path& folder, const TemporaryNames& names, int flags,
                     bool (*is_ours)(const struct stat&)) noexcept {
  try {
    std::error_code error;
    for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      if (!names.areOfThisMachine(entry->path().filename().string())) continue;
      const int fd = openRetrying(entry->path(), flags, 0);
      if (fd < 0) continue;
      struct stat status {};
      if (::fstat(fd, &status) == 0 && is_ours(status) && ::flock(fd, LOCK_EX | LOCK_NB) == 0)
        removeAll(entry->path());
      SystemCalls::current().close(fd);
    }
  } catch (...) {
    // Files that cannot be removed do no harm.
  }
}

TemporarySubfolder::TemporarySubfolder(const std::filesystem::path& parent, std::string_view ending)
    : process_(::getpid()) {
  constexpr int kOpenFolder = O_RDONLY | O_DIRECTORY | O_NOFOLLOW;
  const TemporaryNames names{"curvisplat.", ending};
  removeAbandoned(parent, names, kOpenFolder,
                  [](const struct stat& status) { return status.st_uid == ::geteuid(); });
  std::random_device random;
  while (true) {
    path_ = parent / names.of(random());
    const auto fail = [&] {
      throw Error("{}: cannot be created as a temporary folder: {}", path_.string(), std::strerror(errno));
    };
    if (SystemCalls::current().mkdir(path_.c_str(), 0700) != 0) {
      if (errno == EEXIST) continue;
      fail();
    }
    fd_ = openRetrying(path_, kOpenFolder, 0);
    if (fd_ < 0 && errno == ENOENT) continue;  // taken for abandoned
    if (fd_ < 0) {
      const int reason = errno;
      removeAll(path_);
      errno = reason;
      fail();
    }
    if (lockNew(fd_)) return;
    SystemCalls::current().close(fd_);
  }
}

void TemporarySubfolder::remove() noexcept {
  if (fd_ < 0) return;
  if (::getpid() == process_) removeAll(path_);
  SystemCalls::current().close(fd_);
  fd_ = -1;
}

namespace {

/// Creates a file that nobody else can read, or replace in a folder like /tmp.
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
    removeFileIfThere(file.path);
    throw;
  }
}

InputFile openWithoutName(const std::filesystem::path& path) {
  try {
    InputFile in(path);
    removeFile(path);
    return in;
  } catch (...) {
    removeFileIfThere(path);
    throw;
  }
}

}  // namespace

struct ScratchFiles::State {
  mutable Mutex mutex;
  std::list<std::function<uint64_t()>> files GUARDED_BY(mutex);
  mutable uint64_t most GUARDED_BY(mutex) = 0;

  /// Updates `most`. Files only grow, so that calling it before one of them goes is enough.
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
