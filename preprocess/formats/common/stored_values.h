// Loads numbers as files store them: either byte order, 1 to 8 bytes, unaligned.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "preprocess/formats/common/byte_order.h"

namespace curvisplat {

inline constexpr ByteOrder kMachineByteOrder =
    std::endian::native == std::endian::big ? ByteOrder::kBig : ByteOrder::kLittle;

inline uint8_t byteSwapped(uint8_t bits) {
  return bits;
}
inline uint16_t byteSwapped(uint16_t bits) {
  return __builtin_bswap16(bits);
}
inline uint32_t byteSwapped(uint32_t bits) {
  return __builtin_bswap32(bits);
}
inline uint64_t byteSwapped(uint64_t bits) {
  return __builtin_bswap64(bits);
}

template <size_t kBytes>
using UnsignedOfBytes = std::conditional_t<
    kBytes == 8, uint64_t,
    std::conditional_t<kBytes == 4, uint32_t, std::conditional_t<kBytes == 2, uint16_t, uint8_t>>>;

/// Loads the number at `from`. Stored: an arithmetic type of 1, 2, 4 or 8 bytes.
template <typename Stored>
Stored loadStored(const std::byte* from, bool swap) {
  using Bits = UnsignedOfBytes<sizeof(Stored)>;
  static_assert(sizeof(Stored) == sizeof(Bits));
  Bits bits;
  std::memcpy(&bits, from, sizeof bits);
  return std::bit_cast<Stored>(swap ? byteSwapped(bits) : bits);
}

/// Converts `count` numbers from `from` to `to`. A double that is too large for a float becomes infinite,
/// which blanks its sample.
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
