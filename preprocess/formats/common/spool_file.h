// A temporary file for data that must be unpacked before it can be read by position: numbers in text, and
// compressed blocks that are too large for memory.
//
// SpoolFile is the file; SpooledBytes is a ByteSource that fills it at the first read; NumberSpool writes a
// list of numbers of 8 bytes, which SpooledNumbers reads. The file is nameless, so that it vanishes with the
// process. Any number of threads may read what has been appended.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/error.h"
#include "stream/base/mutex.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// The temporary file. It is created when the first bytes are appended. Thread-safe.
class SpoolFile {
 public:
  explicit SpoolFile(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Takes the next bytes of append().
  using Sink = std::function<void(std::span<const std::byte>)>;

  /// Appends the bytes that `write` passes to its sink, and returns the offset of the first. One writer at a
  /// time; others wait.
  uint64_t append(const std::function<void(const Sink&)>& write);

  /// Only for bytes whose append() has returned.
  void readAt(uint64_t offset, std::span<std::byte> to) const { file_->in().readAt(offset, to); }

 private:
  const std::filesystem::path folder_;
  Mutex mutex_;
  std::unique_ptr<NamelessFile> file_;  // created under the mutex, before the first append() returns
};

/// Two files for lists of several lengths: where each list begins, and the items of all. Lists of all pieces share
/// them, since each open file takes two of the process's descriptors.
struct ListSpools {
  explicit ListSpools(const std::filesystem::path& folder)
      : begins(std::make_shared<SpoolFile>(folder)), items(std::make_shared<SpoolFile>(folder)) {}

  std::shared_ptr<SpoolFile> begins, items;
};

/// Bytes that are produced at the first read and then kept in a spool file.
class SpooledBytes final : public ByteSource {
 public:
  /// `make` passes exactly `size` bytes to its sink, or throws.
  SpooledBytes(std::shared_ptr<SpoolFile> spool, uint64_t size,
               std::function<void(const SpoolFile::Sink&)> make)
      : spool_(std::move(spool)), size_(size), make_(std::move(make)) {}

  uint64_t size() const override { return size_; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

  /// Produces the bytes now unless that has been done, and returns their offset in the spool file. Throws
  /// what `make` throws.
  uint64_t fill() const;

 private:
  std::shared_ptr<SpoolFile> spool_;
  uint64_t size_ = 0;
  mutable Mutex mutex_;
  // Reset after its call, to free its captures.
  mutable std::function<void(const SpoolFile::Sink&)> make_ GUARDED_BY(mutex_);
  mutable std::optional<uint64_t> begin_ GUARDED_BY(mutex_);
};

/// A list of numbers of 8 bytes in a spool file.
struct SpooledNumbers {
  std::shared_ptr<SpoolFile> spool;
  uint64_t offset = 0, count = 0;  // of numbers

  /// Any number of threads. The list must hold numbers of the type that is read.
  void read(uint64_t first, std::span<double> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
  void read(uint64_t first, std::span<uint64_t> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
  void read(uint64_t first, std::span<int64_t> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
};

/// Writes numbers to a spool file, some at a time. For one thread. Several lists may share the file if they
/// are written one after the other.
template <typename Value>
class NumberSpool {
 public:
  static_assert(sizeof(Value) == 8);
  explicit NumberSpool(std::shared_ptr<SpoolFile> spool) { numbers_.spool = std::move(spool); }
  void add(Value value) {
    pending_.push_back(value);
    ++added_;
    if (pending_.size() == kPending) flush();
  }
  uint64_t size() const { return added_; }
  /// The numbers that have been added; more may follow.
  SpooledNumbers soFar() {
    flush();
    return numbers_;
  }
  SpooledNumbers finish() {
    flush();
    return std::move(numbers_);
  }

 private:
  static constexpr size_t kPending = 65536;

  void flush() {
    if (pending_.empty()) return;
    const uint64_t at = numbers_.spool->append(
        [&](const SpoolFile::Sink& sink) { sink(std::as_bytes(std::span(pending_))); });
    if (numbers_.count == 0) numbers_.offset = at;
    CURVISPLAT_CHECK_OP(at, ==, numbers_.offset + 8 * numbers_.count);  // no other list between
    numbers_.count += pending_.size();
    pending_.clear();
  }

  SpooledNumbers numbers_;
  std::vector<Value> pending_;
  uint64_t added_ = 0;
};

}  // namespace curvisplat
