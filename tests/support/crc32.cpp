#include "tests/support/crc32.h"

#include <zlib.h>

namespace curvisplat {

uint32_t crc32(std::span<const std::byte> bytes) {
  return static_cast<uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace curvisplat
