// Bytes in base64: each group of four characters encodes three bytes, so every byte has a known position.
#pragma once

#include "preprocess/formats/common/byte_source.h"

namespace curvisplat {

/// Contiguous base64 without white space. It ends at its padding, or at the end of its range of the file;
/// reading beyond that is an Error.
class Base64Bytes final : public ByteSource {
 public:
  /// The characters [begin, end) of the file, or fewer.
  Base64Bytes(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end);

  uint64_t size() const override { return characters_ / 4 * 3; }
  void readAt(uint64_t offset, std::span<std::byte> to) const override;

  /// Whether the data ends after its first `bytes` bytes (at least 1): the group with the last of them ends
  /// with padding.
  bool endsWith(uint64_t bytes) const;
  /// The base64 that begins with the group after that of the first `bytes` bytes.
  std::shared_ptr<const Base64Bytes> behind(uint64_t bytes) const;

 private:
  std::shared_ptr<const PooledFile> file_;
  uint64_t begin_ = 0, characters_ = 0;
};

}  // namespace curvisplat
