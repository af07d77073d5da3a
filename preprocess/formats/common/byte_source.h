// Bytes of files that are read by position, and the numbers in them.
//
// Readers never hold a whole file. A ByteSource hides how the bytes are stored: raw, in base64, in
// compressed blocks, or as text that has been spooled; a reader asks it for ranges. OpenFiles bounds how
// many files are open at once, since a partitioned data set may have more pieces than a process may have
// open files. loadStored() and convertStored() load numbers of either byte order, 1 to 8 bytes, unaligned.
// existingFile() checks a file that another one names: it has to lie in the folder of that one, or below.
//
// Any number of threads may read from a source, a file or a pool. Reading beyond the end of a file is an
// Error with its name.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <list>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "preprocess/grid/float_offset.h"
#include "stream/base/file.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// The byte order of the numbers in a file.
enum class ByteOrder { kLittle, kBig };

inline constexpr ByteOrder kMachineByteOrder =
    std::endian::native == std::endian::big ? ByteOrder::kBig : ByteOrder::kLittle;

inline uint8_t byteSwapped(uint8_t bits) {
  return bits;
}
inline uint16_t byteSwapped(uint16_t bits) {
  return __builtin_bswap16(bits);
}
inline uint32_t byteSwapped(uint32_t bits) {
  return __builtin_bswap32(bits);
}
inline uint64_t byteSwapped(uint64_t bits) {
  return __builtin_bswap64(bits);
}

template <size_t kBytes>
using UnsignedOfBytes = std::conditional_t<
    kBytes == 8, uint64_t,
    std::conditional_t<kBytes == 4, uint32_t, std::conditional_t<kBytes == 2, uint16_t, uint8_t>>>;

/// Loads the number at `from`. Stored: an arithmetic type of 1, 2, 4 or 8 bytes.
template <typename Stored>
Stored loadStored(const std::byte* from, bool swap) {
  using Bits = UnsignedOfBytes<sizeof(Stored)>;
  static_assert(sizeof(Stored) == sizeof(Bits));
  Bits bits;
  std::memcpy(&bits, from, sizeof bits);
  return std::bit_cast<Stored>(swap ? byteSwapped(bits) : bits);
}

/// A number in the type that is asked for. A double that is too large for a float becomes infinite, which blanks
/// its sample; one that is too small does not become 0, so that a scalar of such values can be told from one of
/// zeros (warningsOfRanges(), preprocess/survey).
template <typename Value, typename Stored>
Value convertedTo(Stored stored) {
  constexpr bool kRounds = std::is_same_v<Value, float> && std::is_same_v<Stored, double>;
  if constexpr (kRounds) stored -= FloatOffset::current();
  const auto value = static_cast<Value>(stored);
  if constexpr (kRounds)
    if (value == 0 && stored != 0)
      return std::copysign(std::numeric_limits<float>::denorm_min(), static_cast<float>(stored));
  return value;
}

/// Converts floats that a library has made of doubles: if all are 0, reads the doubles, by
/// read(std::span<double>), and converts them.
template <typename Read>
void convertIfZero(std::span<float> values, const Read& read) {
  if (FloatOffset::current() == 0 &&
      std::any_of(values.begin(), values.end(), [](float value) { return value != 0; }))
    return;
  std::vector<double> stored(values.size());
  if (!stored.empty()) read(std::span(stored));
  for (size_t n = 0; n < values.size(); ++n) values[n] = convertedTo<float>(stored[n]);
}

/// Converts `count` numbers from `from` to `to`.
template <typename Stored, typename Value>
void convertStored(const std::byte* from, size_t count, bool swap, Value* to) {
  if (swap)
    for (size_t n = 0; n < count; ++n)
      to[n] = convertedTo<Value>(loadStored<Stored>(from + n * sizeof(Stored), true));
  else
    for (size_t n = 0; n < count; ++n)
      to[n] = convertedTo<Value>(loadStored<Stored>(from + n * sizeof(Stored), false));
}

/// Reads `count` numbers of the type Stored from `offset` on, and converts them. `from`: an InputFile, a
/// PooledFile or a ByteSource. Holds 16 KiB of bytes at a time. Throws Error as from.readAt() does.
template <typename Stored, typename Source, typename Value>
void readStored(const Source& from, uint64_t offset, uint64_t count, bool swap, Value* to) {
  constexpr uint64_t kAtOnce = (16 << 10) / sizeof(Stored);
  std::array<std::byte, kAtOnce * sizeof(Stored)> bytes;
  for (uint64_t done = 0; done < count; done += kAtOnce) {
    const auto now = static_cast<size_t>(std::min(kAtOnce, count - done));
    from.readAt(offset + done * sizeof(Stored), std::span(bytes).first(now * sizeof(Stored)));
    convertStored<Stored>(bytes.data(), now, swap, to + done);
  }
}

/// A bounded pool of open input files, most recently used first. Thread-safe.
class OpenFiles {
 public:
  /// Keeps at most 64 files open, or a quarter of those that the process may open (`ulimit -n`).
  OpenFiles();

  /// Opens `path` unless it is open. It stays open while anybody holds the result. Throws Error as InputFile
  /// does.
  std::shared_ptr<const InputFile> at(const std::filesystem::path& path);

 private:
  const size_t most_;
  Mutex mutex_;
  std::list<std::shared_ptr<const InputFile>> files_ GUARDED_BY(mutex_);
};

/// A file of a pool. Any number of threads may read concurrently.
class PooledFile {
 public:
  /// Throws Error if it cannot be opened.
  PooledFile(std::shared_ptr<OpenFiles> pool, std::filesystem::path path);

  const std::filesystem::path& path() const { return path_; }
  /// The path, for error messages.
  std::string name() const { return path_.string(); }
  /// The file's size in bytes when it was first opened.
  uint64_t size() const { return size_; }
  /// Fills `to` with the bytes at `offset`. Throws Error if the file ends before that, or if reading fails.
  void readAt(uint64_t offset, std::span<std::byte> to) const { pool_->at(path_)->readAt(offset, to); }

 private:
  std::shared_ptr<OpenFiles> pool_;
  std::filesystem::path path_;
  uint64_t size_ = 0;
};

/// The first `most` bytes of a file, or as many as it has. Throws Error if reading fails.
std::string beginningOf(const InputFile& file, size_t most);

/// Whether the path `named`, which is relative to `folder` unless it is absolute, lies outside of that folder.
/// Symbolic links are the user's own and not looked at.
bool leadsOut(const std::filesystem::path& folder, const std::filesystem::path& named);

/// The path of a file that another one names: a case, a collection or a series; `folder` is the folder of
/// that one. A file that somebody else has written must not reach the user's other files: throws Error,
/// "WHO names FILE, which lies outside its folder", if the name leads out of it. `who` is like "a.vtm:".
std::filesystem::path namedFile(std::string_view who, const std::filesystem::path& folder,
                                const std::filesystem::path& named);

/// namedFile() of a regular file. Throws Error, "WHO names PATH, which does not exist", if it is none. If
/// only a compressed file of that name exists, the message says so.
std::filesystem::path existingFile(std::string_view who, const std::filesystem::path& folder,
                                   const std::filesystem::path& named);

/// Bytes that are read by position, however the file stores them. Any number of threads may read at once.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  /// Upper bound of the number of bytes.
  virtual uint64_t size() const = 0;
  /// Fills `to` with the bytes at `offset`. Throws Error with the file if the bytes end before that, or if
  /// they are damaged.
  virtual void readAt(uint64_t offset, std::span<std::byte> to) const = 0;
};

/// A range of a file, raw.
class FileBytes final : public ByteSource {
 public:
  /// The bytes [begin, end), cut off at the end of the file.
  FileBytes(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end);

  uint64_t size() const override { return size_; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

 private:
  std::shared_ptr<const PooledFile> file_;
  uint64_t begin_ = 0, size_ = 0;
};

/// Another source without its first `begin` bytes.
class BytesBehind final : public ByteSource {
 public:
  BytesBehind(std::shared_ptr<const ByteSource> all, uint64_t begin);

  uint64_t size() const override { return all_->size() - begin_; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override { all_->readAt(begin_ + offset, to); }

 private:
  std::shared_ptr<const ByteSource> all_;
  uint64_t begin_ = 0;
};

}  // namespace curvisplat
