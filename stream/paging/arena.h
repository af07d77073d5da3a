// An allocator for blocks of any size in memory of a fixed size. Unlike malloc, it bounds the memory that is
// lost to fragmentation between blocks of changing sizes.
//
// First fit, neighbours merge. Blocks begin at multiples of kBlockAlignment. A page that was never used takes
// no memory. One thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <memory>

namespace curvisplat {

class Arena {
 public:
  static constexpr uint64_t kBlockAlignment = 64;

  explicit Arena(uint64_t capacity);

  /// Returns null if no hole is large enough.
  std::byte* allocate(uint64_t bytes);
  /// `bytes` as in allocate().
  void free(std::byte* block, uint64_t bytes);

  /// The memory in bytes that a block of `bytes` takes up.
  static uint64_t charge(uint64_t bytes) {
    return (bytes + kBlockAlignment - 1) / kBlockAlignment * kBlockAlignment;
  }
  uint64_t capacity() const { return capacity_; }

 private:
  struct Free {
    void operator()(std::byte* bytes) const { std::free(bytes); }
  };

  const uint64_t capacity_;
  std::unique_ptr<std::byte, Free> memory_;
  std::map<uint64_t, uint64_t> holes_;  // offset -> bytes, no two touch
};

}  // namespace curvisplat
