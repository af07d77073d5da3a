// A temporary file for data that must be unpacked before it can be read by position: numbers in text, and
// compressed blocks that are too large for memory.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/mutex.h"
#include "stream/base/nameless_file.h"

namespace curvisplat {

/// Created when the first bytes are appended. Thread-safe.
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

/// Bytes that are produced at the first read and then kept in a spool file.
class SpooledBytes final : public ByteSource {
 public:
  /// `make` passes exactly `size` bytes to its sink, or throws.
  SpooledBytes(std::shared_ptr<SpoolFile> spool, uint64_t size,
               std::function<void(const SpoolFile::Sink&)> make)
      : spool_(std::move(spool)), size_(size), make_(std::move(make)) {}

  uint64_t size() const override { return size_; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

  /// Produces the bytes now unless that has been done, and returns their offset in the spool file. Throws what
  /// `make` throws.
  uint64_t fill() const;

 private:
  std::shared_ptr<SpoolFile> spool_;
  uint64_t size_ = 0;
  mutable Mutex mutex_;
  // Reset after its call, to free its captures.
  mutable std::function<void(const SpoolFile::Sink&)> make_ GUARDED_BY(mutex_);
  mutable std::optional<uint64_t> begin_ GUARDED_BY(mutex_);
};

}  // namespace curvisplat
