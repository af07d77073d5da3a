// Bytes that are read by position, independent of how a file stores them: raw, in base64, in compressed
// blocks, or as numbers in text.
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
