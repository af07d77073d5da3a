// Positional file access: all I/O of our own goes through these classes and functions, and they go through
// one table of system calls, so that a test can put a failing disk in its place. (Reads by io_uring do not:
// async_reads.h. Libraries that read or write files themselves do not either: CGNS, HDF5, NetCDF.) Every
// failure is an Error that names the path, the byte offset and the system's reason. Short transfers and EINTR
// are retried; they are not failures.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <system_error>

#include "stream/base/error.h"

namespace curvisplat {

/// The system calls that files are made of. The default is POSIX. Set errno and return -1 to fail.
class SystemCalls {
 public:
  virtual ~SystemCalls() = default;
  virtual int open(const char* path, int flags, unsigned mode);
  virtual int close(int fd);
  virtual ssize_t pread(int fd, void* to, size_t count, int64_t offset);
  virtual ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset);
  virtual int truncate(int fd, int64_t size);
  virtual int fsync(int fd);
  virtual int rename(const char* from, const char* to);
  /// Swaps two names in one step (Linux renameat2).
  virtual int exchange(const char* a, const char* b);
  virtual int mkdir(const char* path, unsigned mode);
  /// A file, or an empty folder.
  virtual int remove(const char* path);

  static SystemCalls& current();
  /// Whether no double is in their place: reads may then go past this table (io_uring).
  static bool areReal();
};

/// Puts `calls` in the place of the system's until the end of the scope. For tests; not while other threads
/// do I/O.
class ScopedSystemCalls {
 public:
  explicit ScopedSystemCalls(SystemCalls& calls);
  ~ScopedSystemCalls();
  ScopedSystemCalls(const ScopedSystemCalls&) = delete;
  ScopedSystemCalls& operator=(const ScopedSystemCalls&) = delete;

 private:
  SystemCalls* previous_;
};

/// Whether transfers go through the page cache, or straight between disk and memory where the file system can
/// (else through the page cache after all). Straight ones need offsets, sizes and addresses that are
/// multiples of kDirectAlignment; they are for large files that are written once and read once.
enum class Caching { kPages, kDirect };
inline constexpr size_t kDirectAlignment = 4096;

/// A file ends before the bytes that were asked for: it was cut off, or is being changed.
class TruncatedFile : public Error {
 public:
  using Error::Error;
};

/// A file that is read by position. Any number of threads may read at once.
class InputFile {
 public:
  /// Throws Error if `path` is missing, not a regular file, or not readable.
  explicit InputFile(std::filesystem::path path, Caching caching = Caching::kPages);
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&& other) noexcept;
  ~InputFile();

  const std::filesystem::path& path() const { return path_; }
  /// Bytes, when it was opened.
  uint64_t size() const { return size_; }

  /// Fills `to` from `offset`. Throws TruncatedFile if the file ends before that, Error if the disk fails.
  void readAt(uint64_t offset, std::span<std::byte> to) const;

  template <typename T>
  void readAt(uint64_t offset, std::span<T> to) const {
    readAt(offset, std::as_writable_bytes(to));
  }

 private:
  std::filesystem::path path_;
  int fd_ = -1;
  uint64_t size_ = 0;
};

/// A file that is written by position, or at its end. Threads may write at once to separate ranges;
/// append() is for one thread at a time. The destructor closes without a word: call close() to learn of a
/// failure.
class OutputFile {
 public:
  enum class Existing { kEmpty, kKeep };

  /// Creates `path`; if it exists, empties it or keeps its bytes. Throws Error.
  explicit OutputFile(std::filesystem::path path, Caching caching = Caching::kPages,
                      Existing existing = Existing::kEmpty);
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&& other) noexcept;
  ~OutputFile();

  const std::filesystem::path& path() const { return path_; }
  /// The end of what was written so far.
  uint64_t size() const { return size_; }

  void append(std::span<const std::byte> from);
  void writeAt(uint64_t offset, std::span<const std::byte> from);
  /// Cuts off what lies behind the first `size` bytes.
  void truncate(uint64_t size);
  /// fsync and close. Nothing may be written after it.
  void close();

  template <typename T>
  void append(std::span<const T> from) {
    append(std::as_bytes(from));
  }

 private:
  std::filesystem::path path_;
  int fd_ = -1;
  std::atomic<uint64_t> size_ = 0;
};

/// The whole of a small file (at most `limit` bytes, else an Error).
std::string readTextFile(const std::filesystem::path& path, uint64_t limit = 16 << 20);

/// Writes `bytes` beside `path`, syncs and renames them: then `path` is the old file or the whole new one,
/// whatever happens; which, after a power loss, is certain once its folder has been synced. For a file that
/// has one writer at a time; others are in durable_file.h.
void writeFileAtomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void writeFileAtomically(const std::filesystem::path& path, const std::string& text);

/// fsync of a directory, so that the names in it survive a power loss.
void syncDirectory(const std::filesystem::path& path);

/// Makes a folder whose parent is there. Throws Error, also if something has the name.
void makeFolder(const std::filesystem::path& path);
/// Removes a file or an empty folder. Throws Error, also if there is none.
void removeFile(const std::filesystem::path& path);
/// Removes a file, or a folder and all in it, as far as it goes. Returns what stood in the way first; that
/// nothing is there does not.
std::error_code removeAll(const std::filesystem::path& path) noexcept;

}  // namespace curvisplat
