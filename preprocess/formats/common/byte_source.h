// Bytes that are read by position, however a file stores them: as they are, in base64, in compressed blocks,
// or as numbers in text. What reads them need not know.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "preprocess/formats/common/open_files.h"

namespace curvisplat {

/// Any number of threads may read at once.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  /// How many bytes there can be at most.
  virtual uint64_t size() const = 0;
  /// Fills `to` from `offset`. Throws Error naming the file if there are not so many bytes, or if they are
  /// damaged.
  virtual void readAt(uint64_t offset, std::span<std::byte> to) const = 0;
};

/// A part of a file, as it is.
class FileBytes final : public ByteSource {
 public:
  /// The bytes from `begin` up to `end`, or to the end of the file if that comes before.
  FileBytes(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end);

  uint64_t size() const override { return size_; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

 private:
  std::shared_ptr<const PooledFile> file_;
  uint64_t begin_ = 0, size_ = 0;
};

/// What follows the first `begin` bytes of another source.
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
