// Numbers as files store them: either byte order, 4 or 8 bytes, unaligned.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "preprocess/plot3d_layout.h"

namespace curvisplat {

inline constexpr ByteOrder kMachineByteOrder =
    std::endian::native == std::endian::big ? ByteOrder::big : ByteOrder::little;

inline uint32_t byteSwapped(uint32_t bits) {
  return __builtin_bswap32(bits);
}
inline uint64_t byteSwapped(uint64_t bits) {
  return __builtin_bswap64(bits);
}

/// The number at `from`. Stored: a 4- or 8-byte arithmetic type.
template <typename Stored>
Stored loadStored(const std::byte* from, bool swap) {
  using Bits = std::conditional_t<sizeof(Stored) == 8, uint64_t, uint32_t>;
  static_assert(sizeof(Stored) == sizeof(Bits));
  Bits bits;
  std::memcpy(&bits, from, sizeof bits);
  return std::bit_cast<Stored>(swap ? byteSwapped(bits) : bits);
}

/// `count` numbers from `from` to `to`, converted. A double too large for a float becomes infinite, and so
/// blank.
template <typename Stored, typename Value>
void convertStored(const std::byte* from, size_t count, bool swap, Value* to) {
  if (swap)
    for (size_t n = 0; n < count; ++n)
      to[n] = static_cast<Value>(loadStored<Stored>(from + n * sizeof(Stored), true));
  else
    for (size_t n = 0; n < count; ++n)
      to[n] = static_cast<Value>(loadStored<Stored>(from + n * sizeof(Stored), false));
}

}  // namespace curvisplat
