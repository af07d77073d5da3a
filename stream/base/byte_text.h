// Sizes in bytes, for people.
#pragma once

#include <cstdint>
#include <string>

namespace curvisplat {

/// "1 byte", "512 bytes", "1 KiB", "1.5 MiB", "96.25 GiB": four digits, so that sizes that differ by little read
/// differently; units are powers of 1024.
std::string byteText(uint64_t bytes);

}  // namespace curvisplat
