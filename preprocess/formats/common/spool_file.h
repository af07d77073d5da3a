// One temporary file for all that must be unpacked before it can be read by position: numbers in text, and
// compressed blocks that are too large for memory.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Made when the first bytes come. It has no name any more from then on: it goes when its last user does,
/// however the program ends. Any number of threads may use it.
class SpoolFile {
 public:
  explicit SpoolFile(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Where `write` puts bytes, one after the other.
  using Sink = std::function<void(std::span<const std::byte>)>;

  /// Appends what `write` gives to its sink. One writer at a time; others wait. Returns where it begins.
  uint64_t append(const std::function<void(const Sink&)>& write);

  /// Bytes that append() has returned from.
  void readAt(uint64_t offset, std::span<std::byte> to) const { in_->readAt(offset, to); }

 private:
  void create();

  const std::filesystem::path folder_;
  std::mutex mutex_;  // guards out_, and the making of in_
  std::unique_ptr<OutputFile> out_;
  std::unique_ptr<InputFile> in_;
};

/// Bytes that are made when the first of them is read, and lie in a spool file from then on.
class SpooledBytes final : public ByteSource {
 public:
  /// `make` gives exactly `size` bytes to its sink, or throws.
  SpooledBytes(std::shared_ptr<SpoolFile> spool, uint64_t size,
               std::function<void(const SpoolFile::Sink&)> make)
      : spool_(std::move(spool)), size_(size), make_(std::move(make)) {}

  uint64_t size() const override { return size_; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

  /// Makes them now, if they are not there. Throws what `make` throws.
  void fill() const;

 private:
  std::shared_ptr<SpoolFile> spool_;
  uint64_t size_ = 0;
  mutable std::mutex mutex_;                                  // guards what follows
  mutable std::function<void(const SpoolFile::Sink&)> make_;  // let go of once they are there
  mutable std::optional<uint64_t> begin_;
};

}  // namespace curvisplat
