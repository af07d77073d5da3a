// Arrays of small integers as bytes: each array is cut into planes (all lowest bytes, then all second bytes,
// ...), as many as its largest value needs, and the planes go through zstd, a block each, so that each has
// its own statistics.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/prediction.h"

namespace curvisplat {

/// How one array is coded: a byte each in a stream's header.
struct ArrayCode {
  Predictor predictor = Predictor::kNone;
  uint8_t planes = 0;
};
static_assert(sizeof(ArrayCode) == 2);

/// False if untrusted bytes say something that no encoder would.
inline bool isPossible(const ArrayCode& code) {
  return static_cast<int>(code.predictor) < kPredictors && code.planes <= 4;
}

/// Collects bytes and planes, and compresses them behind a header. Uses one zstd context a thread.
class PlaneWriter {
 public:
  /// Bytes as they are.
  void addBytes(std::span<const std::byte> bytes);
  /// Adds `values`, and returns the number of planes (0..4) that they took.
  uint8_t add(std::span<const uint32_t> values);

  /// `header`, then one zstd frame with everything added.
  std::vector<std::byte> compress(std::span<const std::byte> header) const;

 private:
  std::vector<std::byte> bytes_;
  std::vector<size_t> ends_;  // of the planes in bytes_
};

/// Takes apart what a PlaneWriter has written. The bytes are untrusted: every call throws Error where they do
/// not hold what is asked for. One at a time on a thread: the unpacked bytes lie in the thread's scratch.
class PlaneReader {
 public:
  /// `frame` must unpack to exactly `unpacked_bytes`.
  PlaneReader(std::span<const std::byte> frame, size_t unpacked_bytes);

  std::span<const std::byte> bytes(size_t count);
  /// Joins `planes` (0..4) planes to values.size() integers.
  void values(uint8_t planes, std::span<uint32_t> values);

 private:
  std::span<const std::byte> rest_;
};

/// Little-endian base 128: seven bits a byte, the highest bit says that more follow.
void appendVarint(std::vector<std::byte>& bytes, uint64_t value);
/// Takes one off the front of `bytes`. Throws Error if it does not end or does not fit 64 bits.
uint64_t takeVarint(std::span<const std::byte>& bytes);

}  // namespace curvisplat
