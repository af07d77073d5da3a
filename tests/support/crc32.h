// CRC-32 as zlib, and so Python, computes it: for checksums that another program has made.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace curvisplat {

uint32_t crc32(std::span<const std::byte> bytes);

}  // namespace curvisplat
