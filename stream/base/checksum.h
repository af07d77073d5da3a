// The cache's only checksum: 64-bit XXH3, with seed 0, of the bytes as they are in the file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace curvisplat {

uint64_t checksumOf(std::span<const std::byte> bytes);

/// The same checksum, of bytes that arrive in pieces.
class Checksum {
 public:
  Checksum();
  ~Checksum();
  Checksum(const Checksum&) = delete;
  Checksum& operator=(const Checksum&) = delete;

  void add(std::span<const std::byte> bytes);
  uint64_t value() const;

 private:
  void* state_;  // XXH3_state_t
};

}  // namespace curvisplat
