// Bytes in base64: four characters stand for three bytes, so each byte has its place in the text.
#pragma once

#include "preprocess/formats/common/byte_source.h"

namespace curvisplat {

/// A run of base64 without white space in it. It ends where its padding says, or at the end of the part of
/// the file it is in; what is asked for behind that is an Error.
class Base64Bytes final : public ByteSource {
 public:
  /// The characters from `begin` up to `end` at most.
  Base64Bytes(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end);

  uint64_t size() const override { return characters_ / 4 * 3; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

  /// True if the run ends with the first `bytes` bytes (1 or more): its fours of characters up to there end
  /// with padding.
  bool endsWith(uint64_t bytes) const;
  /// The run that begins with the four of characters behind those of the first `bytes` bytes.
  std::shared_ptr<const Base64Bytes> behind(uint64_t bytes) const;

 private:
  std::shared_ptr<const PooledFile> file_;
  uint64_t begin_ = 0, characters_ = 0;
};

}  // namespace curvisplat
