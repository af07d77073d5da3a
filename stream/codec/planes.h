// Arrays of small integers as compressed bytes. Each array is cut into byte planes (all lowest bytes, then
// all second bytes, and so on), as many as its largest value needs. The planes are compressed by zstd, each
// in its own block unless it is short, so that each has its own statistics.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/codec/prediction.h"

namespace curvisplat {

/// How one array is coded: two bytes of a stream's header.
struct ArrayCode {
  Predictor predictor = Predictor::kNone;
  uint8_t planes = 0;
};
static_assert(sizeof(ArrayCode) == 2);

/// Whether untrusted bytes are a valid code.
inline bool isPossible(const ArrayCode& code) {
  return static_cast<int>(code.predictor) < kPredictors && code.planes <= 4;
}

/// Collects bytes and planes, and compresses them. Each thread has its own zstd context.
class PlaneWriter {
 public:
  /// Adds bytes unchanged.
  void addBytes(std::span<const std::byte> bytes);
  /// Adds the planes of `values`. Returns their number (0 to 4).
  uint8_t add(std::span<const uint32_t> values);

  /// Returns `header`, followed by one zstd frame of everything added.
  std::vector<std::byte> compress(std::span<const std::byte> header) const;

 private:
  std::vector<std::byte> bytes_;
  std::vector<size_t> ends_;  // of the planes in bytes_
};

/// Unpacks the frame of a PlaneWriter. The bytes are untrusted: every function throws Error if they do not
/// hold the requested data. A thread may use only one PlaneReader at a time, because the unpacked bytes are
/// in the thread's scratch.
class PlaneReader {
 public:
  /// Throws Error unless `frame` unpacks to exactly `unpacked_bytes`.
  PlaneReader(std::span<const std::byte> frame, size_t unpacked_bytes);

  /// The next `count` bytes.
  std::span<const std::byte> bytes(size_t count);
  /// Joins the next `planes` (0 to 4) planes to values.size() integers.
  void values(uint8_t planes, std::span<uint32_t> values);

 private:
  std::span<const std::byte> rest_;
};

/// Appends `value` in little-endian base 128: seven bits per byte; the highest bit is set in all bytes but
/// the last.
void appendVarint(std::vector<std::byte>& bytes, uint64_t value);
/// Removes a varint from the front of `bytes` and returns its value. Throws Error if it is truncated or
/// exceeds 64 bits.
uint64_t takeVarint(std::span<const std::byte>& bytes);

}  // namespace curvisplat
