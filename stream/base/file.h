// Positional file access, and the paths that users supply.
//
// All I/O of the program's own code goes through these classes and functions, and they go through one table
// of system calls (SystemCalls), so that a test can substitute a failing disk. Two kinds of reads bypass the
// table: those by io_uring (stream/paging/async_reads.h), and those of libraries that do their own I/O
// (CGNS, HDF5, NetCDF).
//
// Every failure is an Error that names the path, the byte offset and the system's reason; it is a DiskFull
// (stream/base/disk_space.h) where there is no space. Short transfers and EINTR are not failures: they are
// retried. Any thread may call the functions; the classes say what their threads may do.
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

/// The folder that contains `path`: "." for a plain name.
std::filesystem::path folderOf(const std::filesystem::path& path);

/// The ending of the name in small letters: ".png" for "a.PNG"; empty if there is none.
std::string extensionOf(const std::filesystem::path& path);

/// Whether `path` is a regular file, or links that end at one. False for names that no file can have, such
/// as names that are too long.
bool isRegularFile(const std::filesystem::path& path) noexcept;

/// Whether there is something of this name, or at the end of its links. Throws Error if that cannot be told, as for lack of rights or
/// links in a circle, and for a link to nothing: only what is not there is missing.
bool isThere(const std::filesystem::path& path);
/// The same; throws Error also if it is no regular file.
bool isFileThere(const std::filesystem::path& path);

/// `path` itself, or the path at the end of its symbolic links, whether that exists or not. Throws Error if
/// the links form a cycle.
std::filesystem::path linkTarget(std::filesystem::path path);

/// linkTarget() for a file to be written. Throws Error if the target exists and is not a regular file.
std::filesystem::path writableTarget(const std::filesystem::path& path);

/// The system calls behind file access. The default calls POSIX. An override fails by setting errno and
/// returning -1.
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
  /// Removes a file or an empty folder.
  virtual int remove(const char* path);

  static SystemCalls& current();
  /// Whether the POSIX calls are in place, not a test's double. Only then may reads bypass this table
  /// (io_uring).
  static bool areReal();
};

/// Substitutes `calls` for the system's until the end of the scope. For tests only, and not while other
/// threads do I/O.
class ScopedSystemCalls {
 public:
  explicit ScopedSystemCalls(SystemCalls& calls);
  ~ScopedSystemCalls();
  ScopedSystemCalls(const ScopedSystemCalls&) = delete;
  ScopedSystemCalls& operator=(const ScopedSystemCalls&) = delete;

 private:
  SystemCalls* previous_;
};

/// SystemCalls::open() with O_CLOEXEC, retried on EINTR. Returns the descriptor, or -1 with errno set. It is
/// for code that keeps the descriptor; files that are only read or written are an InputFile or an
/// OutputFile.
int openRetrying(const std::filesystem::path& path, int flags, unsigned mode = 0);

/// kPages: transfers go through the page cache. kDirect: transfers bypass it if the file system can
/// (O_DIRECT), and fall back to the page cache otherwise. Direct transfers need offsets, sizes and addresses
/// that are multiples of kDirectAlignment. They are for large files that are written once and read once.
enum class Caching { kPages, kDirect };
inline constexpr size_t kDirectAlignment = 4096;

/// A file ends before the requested bytes: it was truncated, or is being changed.
class TruncatedFile : public Error {
 public:
  using Error::Error;
};

/// A file that is read by position. Any number of threads may read at the same time.
class InputFile {
 public:
  /// Throws Error if `path` is missing, not a regular file, or not readable.
  explicit InputFile(std::filesystem::path path, Caching caching = Caching::kPages);
  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&& other) noexcept;
  ~InputFile();

  const std::filesystem::path& path() const { return path_; }
  /// Size in bytes when the file was opened.
  uint64_t size() const { return size_; }

  /// Fills `to` with the bytes at `offset`. Throws TruncatedFile if the file ends first, Error if the disk
  /// fails.
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

class Progress;

/// Makes this thread's reads of InputFiles throw Interrupted once `progress` is stopped, while it lives. It serves the opening of
/// grids, where readers of many formats loop by themselves. Work that reads to clean up cannot use it.
class StoppableReads {
 public:
  /// `progress` outlives it.
  explicit StoppableReads(const Progress& progress);
  ~StoppableReads();
  StoppableReads(const StoppableReads&) = delete;
  StoppableReads& operator=(const StoppableReads&) = delete;

 private:
  const Progress* const before_;
};

/// A file that is written by position or at its end. Threads may write separate ranges at the same time;
/// append() is for one thread at a time. The destructor closes the file and ignores errors: call close() to
/// detect them.
class OutputFile {
 public:
  enum class Existing { kEmpty, kKeep };

  /// Creates `path`. If it exists, empties it or keeps its bytes. Throws Error if that fails. Messages name
  /// `shown` instead of `path` unless it is empty: a user has never heard of a temporary file, but knows
  /// what it is for.
  explicit OutputFile(std::filesystem::path path, Caching caching = Caching::kPages,
                      Existing existing = Existing::kEmpty, std::filesystem::path shown = {});
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&& other) noexcept;
  ~OutputFile();

  const std::filesystem::path& path() const { return path_; }
  /// The end of the last byte written so far.
  uint64_t size() const { return size_; }

  void append(std::span<const std::byte> from);
  void writeAt(uint64_t offset, std::span<const std::byte> from);
  /// Keeps the first `size` bytes and discards the rest.
  void truncate(uint64_t size);
  /// Syncs (fsync). Throws Error if it fails.
  void sync();
  /// Syncs (fsync) and closes. Nothing may be written afterwards. Throws Error if either fails.
  void close();

  template <typename T>
  void append(std::span<const T> from) {
    append(std::as_bytes(from));
  }

 private:
  std::filesystem::path path_, shown_;
  int fd_ = -1;
  std::atomic<uint64_t> size_ = 0;
};

/// The contents of a small file. Throws Error if it has more than `limit` bytes.
std::string readTextFile(const std::filesystem::path& path, uint64_t limit = 16 << 20);

/// Writes `bytes` to a temporary file beside `path`, syncs it and renames it to `path`. At any moment `path`
/// is either the old file or the complete new one. The rename survives a power loss once the folder has been
/// synced, which is the caller's task. Only one writer at a time; durable_file.h has no such limit.
void writeFileAtomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void writeFileAtomically(const std::filesystem::path& path, const std::string& text);

/// Syncs (fsync) a folder, so that the names in it survive a power loss.
void syncDirectory(const std::filesystem::path& path);

/// Makes a folder in an existing parent. Throws Error, also if the name exists already.
void makeFolder(const std::filesystem::path& path, unsigned mode = 0777);
/// Makes a folder and those above it that are missing, which nobody else can enter: for copies of a user's data in
/// places that the user did not choose. A folder that exists keeps its rights. Throws Error.
void makePrivateFolders(const std::filesystem::path& path);
/// Removes a file or an empty folder. Throws Error, also if the name does not exist.
void removeFile(const std::filesystem::path& path);
/// Removes a file or a link, if there is one of this name, and returns why it could not. A folder is left: where this program
/// makes a file of the name, a folder is the user's.
std::error_code removeFileIfThere(const std::filesystem::path& path) noexcept;
/// Removes a file, or a folder and everything in it, and continues past failures. Returns the first failure.
/// A name that does not exist is not a failure.
std::error_code removeAll(const std::filesystem::path& path) noexcept;

}  // namespace curvisplat
