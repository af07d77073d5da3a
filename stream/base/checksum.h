// The one checksum of the cache: XXH3, 64 bit, of bytes as they are in a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace curvisplat {

uint64_t checksumOf(std::span<const std::byte> bytes);

/// The same of bytes that come in pieces.
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
