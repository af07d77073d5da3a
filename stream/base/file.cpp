#include "stream/base/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>
#include <utility>

#include "stream/base/disk_space.h"
#include "stream/base/error.h"
#include "stream/base/mirror.h"
#include "stream/base/os.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

SystemCalls posix_calls;
std::atomic<SystemCalls*> current_calls{&posix_calls};

// Linux transfers at most 0x7ffff000 bytes a call. This is a whole number of pages below that limit.
constexpr size_t kLargestTransfer = size_t{1} << 30;

std::string reason() {
  return std::strerror(errno);
}

/// openRetrying() with the flag for direct transfers for Caching::kDirect, and without it where the file system refuses the flag.
int openWith(Caching caching, const std::filesystem::path& path, int flags, unsigned mode) {
  if (caching == Caching::kDirect) {
    const int fd = openRetrying(path, flags | os::directFlag(), mode);
    if (fd >= 0 || errno != EINVAL) return fd;
  }
  return openRetrying(path, flags, mode);
}

/// Whether alignment was the reason for a failed transfer. If so, switches the descriptor to the page cache,
/// so that the transfer can be retried. (A short transfer continues at any byte, aligned or not.)
bool stoppedBeingDirect(int fd) {
  if (errno != EINVAL) return false;
  const int flags = ::fcntl(fd, F_GETFL);
  return flags >= 0 && (flags & os::directFlag()) != 0 &&
         ::fcntl(fd, F_SETFL, flags & ~os::directFlag()) == 0;
}

/// Throws the error of `file` for a value of errno: DiskFull if there is no space for `what`, otherwise an
/// OutputError that says what `cannot` be done. Messages name `shown`.
[[noreturn]] void fail(int error, const std::filesystem::path& file, const std::filesystem::path& shown,
                       const std::string& what, const std::string& cannot) {
  if (DiskFull::is(error)) throw DiskFull(file, shown, what, error);
  throw OutputError("{}: {}: {}", shown.string(), cannot, std::strerror(error));
}

void syncRetrying(int fd, const std::filesystem::path& path, const std::filesystem::path& shown) {
  int result;
  do {
    result = SystemCalls::current().fsync(fd);
  } while (result < 0 && errno == EINTR);
  // EINVAL and ENOTSUP: the file system cannot sync a directory or a pipe. The disk has not failed.
  if (result < 0 && errno != EINVAL && errno != ENOTSUP)
    fail(errno, path, shown, "what was written", "cannot be synced to the disk");
}

}  // namespace

std::filesystem::path folderOf(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

std::string extensionOf(const std::filesystem::path& path) {
  return lowerCase(path.extension().string());
}

bool isRegularFile(const std::filesystem::path& path) noexcept {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

bool isThere(const std::filesystem::path& path) {
  std::error_code error, ignored;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (std::filesystem::status_known(status) && std::filesystem::exists(status)) return true;
  if (status.type() != std::filesystem::file_type::not_found)
    throw Error("{}: cannot be looked at: {}", path.string(), error.message());
  if (std::filesystem::is_symlink(path, ignored))
    throw Error("{}: is a link to {}, which does not exist", path.string(),
                std::filesystem::read_symlink(path, ignored).string());
  return false;
}

bool isFileThere(const std::filesystem::path& path) {
  if (!isThere(path)) return false;
  if (!isRegularFile(path)) throw Error("{}: is not a regular file", path.string());
  return true;
}

std::filesystem::path linkTarget(std::filesystem::path path) {
  constexpr int kMaxLinks = 40;  // the kernel's limit
  const std::filesystem::path first = path;
  for (int links = 0; links <= kMaxLinks; ++links) {
    std::error_code ignored;
    if (!std::filesystem::is_symlink(path, ignored)) return path;
    path =
        folderOf(path) / std::filesystem::read_symlink(path);  // an absolute target replaces the whole path
  }
  throw Error("{}: its symbolic links form a cycle", first.string());
}

std::filesystem::path writableTarget(const std::filesystem::path& path) {
  const std::filesystem::path target = linkTarget(path);
  std::error_code ignored;
  if (std::filesystem::exists(target, ignored) && !isRegularFile(target))
    throw Error("{}: exists and is not a regular file; choose another name", path.string());
  return target;
}

int SystemCalls::open(const char* path, int flags, unsigned mode) {
  if (const int error = MirrorCalls::prepare(path, flags)) {
    errno = error;
    return -1;
  }
  const int fd = ::open(path, flags, mode);
  if (fd >= 0) MirrorCalls::opened(fd, path, flags);
  return fd;
}
int SystemCalls::close(int fd) {
  MirrorCalls::closed(fd);
  return ::close(fd);
}
ssize_t SystemCalls::pread(int fd, void* to, size_t count, int64_t offset) {
  if (const int error = MirrorCalls::read(fd, static_cast<uint64_t>(offset), count)) {
    errno = error;
    return -1;
  }
  return ::pread(fd, to, count, offset);
}
ssize_t SystemCalls::pwrite(int fd, const void* from, size_t count, int64_t offset) {
  return ::pwrite(fd, from, count, offset);
}
int SystemCalls::truncate(int fd, int64_t size) {
  return ::ftruncate(fd, size);
}
int SystemCalls::fsync(int fd) {
  return ::fsync(fd);
}
int SystemCalls::rename(const char* from, const char* to) {
  return std::rename(from, to);
}
int SystemCalls::exchange(const char* a, const char* b) {
  return os::exchangeNames(a, b);
}
int SystemCalls::mkdir(const char* path, unsigned mode) {
  return ::mkdir(path, mode);
}
int SystemCalls::remove(const char* path) {
  return std::remove(path);
}
SystemCalls& SystemCalls::current() {
  return *current_calls.load(std::memory_order_acquire);
}

bool SystemCalls::areReal() {
  return current_calls.load(std::memory_order_acquire) == &posix_calls;
}

ScopedSystemCalls::ScopedSystemCalls(SystemCalls& calls) : previous_(current_calls.exchange(&calls)) {}
ScopedSystemCalls::~ScopedSystemCalls() {
  current_calls.store(previous_);
}

int openRetrying(const std::filesystem::path& path, int flags, unsigned mode) {
  int fd;
  do {
    fd = SystemCalls::current().open(path.c_str(), flags | O_CLOEXEC, mode);
  } while (fd < 0 && errno == EINTR);
  return fd;
}

InputFile::InputFile(std::filesystem::path path, Caching caching) : path_(std::move(path)) {
  // Without O_NONBLOCK, opening a named pipe would wait for a writer.
  fd_ = openWith(caching, path_, O_RDONLY | O_NONBLOCK, 0);
  if (fd_ < 0) throw Error("{}: cannot be opened for reading: {}", path_.string(), reason());
  struct stat status {};
  const std::string why = ::fstat(fd_, &status) < 0 ? "the file size cannot be determined: " + reason()
                          : S_ISREG(status.st_mode) ? ""
                                                    : "is not a regular file";
  if (!why.empty()) {
    SystemCalls::current().close(std::exchange(fd_, -1));
    throw Error("{}: {}", path_.string(), why);
  }
  size_ = static_cast<uint64_t>(status.st_size);
}

InputFile::InputFile(InputFile&& other) noexcept
    : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)), size_(other.size_) {}

InputFile& InputFile::operator=(InputFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(fd_, other.fd_);
  std::swap(size_, other.size_);
  return *this;
}

InputFile::~InputFile() {
  if (fd_ >= 0) SystemCalls::current().close(fd_);
}

namespace {
thread_local const Progress* stops_reads = nullptr;  // StoppableReads
}  // namespace

StoppableReads::StoppableReads(const Progress& progress) : before_(std::exchange(stops_reads, &progress)) {}

StoppableReads::~StoppableReads() {
  stops_reads = before_;
}

void InputFile::readAt(uint64_t offset, std::span<std::byte> to) const {
  if (stops_reads) stops_reads->throwIfStopped();
  size_t done = 0;
  while (done < to.size()) {
    const size_t count = std::min(to.size() - done, kLargestTransfer);
    const ssize_t got =
        SystemCalls::current().pread(fd_, to.data() + done, count, static_cast<int64_t>(offset + done));
    if (got < 0) {
      if (errno == EINTR || stoppedBeingDirect(fd_)) continue;
      throw Error("{}: cannot read {} bytes at offset {}: {}", path_.string(), count, offset + done,
                  reason());
    }
    if (got == 0)
      throw TruncatedFile("{}: is truncated: ends at byte {}, expected {} bytes from offset {}",
                          path_.string(), offset + done, to.size(), offset);
    done += static_cast<size_t>(got);
  }
}

OutputFile::OutputFile(std::filesystem::path path, Caching caching, Existing existing,
                       std::filesystem::path shown)
    : path_(std::move(path)), shown_(shown.empty() ? path_ : std::move(shown)) {
  const int empty = existing == Existing::kEmpty ? O_TRUNC : 0;
  fd_ = openWith(caching, path_, O_RDWR | O_CREAT | empty, 0666);
  if (fd_ < 0) fail(errno, path_, shown_, "a new file", "cannot be opened for writing");
  struct stat status {};
  if (::fstat(fd_, &status) < 0) {
    const std::string why = reason();
    SystemCalls::current().close(std::exchange(fd_, -1));
    throw OutputError("{}: cannot determine the file size: {}", shown_.string(), why);
  }
  size_ = static_cast<uint64_t>(status.st_size);
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      shown_(std::move(other.shown_)),
      fd_(std::exchange(other.fd_, -1)),
      size_(other.size_.load()) {}

OutputFile& OutputFile::operator=(OutputFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(shown_, other.shown_);
  std::swap(fd_, other.fd_);
  size_ = other.size_.exchange(size_.load());
  return *this;
}

OutputFile::~OutputFile() {
  if (fd_ >= 0) SystemCalls::current().close(fd_);
}

void OutputFile::append(std::span<const std::byte> from) {
  writeAt(size_, from);
}

void OutputFile::writeAt(uint64_t offset, std::span<const std::byte> from) {
  size_t done = 0;
  while (done < from.size()) {
    const size_t count = std::min(from.size() - done, kLargestTransfer);
    const ssize_t put =
        SystemCalls::current().pwrite(fd_, from.data() + done, count, static_cast<int64_t>(offset + done));
    if (put < 0) {
      if (errno == EINTR || stoppedBeingDirect(fd_)) continue;
      const int error = errno;
      fail(error, path_, shown_, fmt::format("{} more bytes", count),
           fmt::format("cannot write {} bytes at offset {}", count, offset + done));
    }
    done += static_cast<size_t>(put);
  }
  const uint64_t end = offset + from.size();
  uint64_t size = size_.load();
  while (size < end && !size_.compare_exchange_weak(size, end)) {
  }
}

void OutputFile::truncate(uint64_t size) {
  CURVISPLAT_CHECK_OP(size, <=, size_.load());
  int result;
  do {
    result = SystemCalls::current().truncate(fd_, static_cast<int64_t>(size));
  } while (result < 0 && errno == EINTR);
  if (result < 0)
    throw OutputError("{}: cannot be truncated to {} bytes: {}", shown_.string(), size, reason());
  size_ = size;
}

void OutputFile::sync() {
  CURVISPLAT_CHECK(fd_ >= 0);
  syncRetrying(fd_, path_, shown_);
}

void OutputFile::close() {
  sync();
  if (SystemCalls::current().close(std::exchange(fd_, -1)) < 0 && errno != EINTR)
    fail(errno, path_, shown_, "what was written", "cannot be closed");
}

std::string readTextFile(const std::filesystem::path& path, uint64_t limit) {
  const InputFile file(path);
  if (file.size() > limit)
    throw Error("{}: is too large for its kind of file (found {} bytes, expected at most {})", path.string(),
                file.size(), limit);
  std::string text(file.size(), '\0');
  file.readAt(0, std::span(text.data(), text.size()));
  return text;
}

void writeFileAtomically(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  const std::filesystem::path temporary = path.string() + ".part";
  // What is there may be a link that leads anywhere: it would be followed.
  SystemCalls::current().remove(temporary.c_str());
  try {
    OutputFile file(temporary, Caching::kPages, OutputFile::Existing::kEmpty, path);
    file.append(bytes);
    file.close();
    if (SystemCalls::current().rename(temporary.c_str(), path.c_str()) < 0)
      failToRename(errno, temporary, path);
  } catch (...) {
    removeFileIfThere(temporary);
    throw;
  }
}

void writeFileAtomically(const std::filesystem::path& path, const std::string& text) {
  writeFileAtomically(path, std::as_bytes(std::span(text)));
}

void syncDirectory(const std::filesystem::path& path) {
  const int fd = openRetrying(path, O_RDONLY | O_DIRECTORY, 0);
  if (fd < 0) throw OutputError("{}: cannot be opened: {}", path.string(), reason());
  try {
    syncRetrying(fd, path, path);
  } catch (...) {
    SystemCalls::current().close(fd);
    throw;
  }
  SystemCalls::current().close(fd);
}

void makePrivateFolders(const std::filesystem::path& path) {
  std::error_code error;
  if (path.empty() || std::filesystem::is_directory(path, error)) return;
  if (path != path.parent_path()) makePrivateFolders(path.parent_path());
  try {
    makeFolder(path, 0700);
  } catch (const Error&) {
    // Another program may have made it at the same time.
    if (!std::filesystem::is_directory(path, error)) throw;
  }
}

void makeFolder(const std::filesystem::path& path, unsigned mode) {
  if (SystemCalls::current().mkdir(path.c_str(), mode) == 0) return;
  const int error = errno;
  if (DiskFull::is(error)) throw DiskFull(path, folderOf(path), "a new directory", error);
  throw OutputError("{}: the directory cannot be created: {}", path.string(), std::strerror(error));
}

void removeFile(const std::filesystem::path& path) {
  if (SystemCalls::current().remove(path.c_str()) < 0)
    throw OutputError("{}: cannot be removed: {}", path.string(), reason());
}

std::error_code removeFileIfThere(const std::filesystem::path& path) noexcept {
  std::error_code error;
  if (std::filesystem::is_directory(std::filesystem::symlink_status(path, error)))
    return std::make_error_code(std::errc::is_a_directory);
  if (SystemCalls::current().remove(path.c_str()) == 0 || errno == ENOENT) return {};
  return {errno, std::generic_category()};
}

std::error_code removeAll(const std::filesystem::path& path) noexcept {
  namespace fs = std::filesystem;
  std::error_code first;
  try {
    std::error_code error;
    const bool is_folder = fs::is_directory(fs::symlink_status(path, error));
    if (is_folder)
      for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error))
        if (const std::error_code inside = removeAll(entry->path()); !first) first = inside;
    if (SystemCalls::current().remove(path.c_str()) < 0 && errno != ENOENT && !first)
      first = {errno, std::generic_category()};
  } catch (...) {
    if (!first) first = std::make_error_code(std::errc::not_enough_memory);
  }
  return first;
}

}  // namespace curvisplat
