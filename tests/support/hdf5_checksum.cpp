#include "tests/support/hdf5_checksum.h"

#include <array>
#include <bit>
#include <cstring>

namespace curvisplat {

// Source: lookup3.c, May 2006, Bob Jenkins, public domain: hashlittle() of an initial value of 0.
uint32_t hdf5Checksum(std::string_view bytes) {
  const auto start = 0xdeadbeef + static_cast<uint32_t>(bytes.size());
  uint32_t a = start, b = start, c = start;
  std::array<uint32_t, 3> word{};
  const auto add = [&](std::string_view some) {
    word = {};
    std::memcpy(word.data(), some.data(), some.size());
    a += word[0];
    b += word[1];
    c += word[2];
  };
  while (bytes.size() > 12) {
    add(bytes.substr(0, 12));
    a = (a - c) ^ std::rotl(c, 4), c += b;
    b = (b - a) ^ std::rotl(a, 6), a += c;
    c = (c - b) ^ std::rotl(b, 8), b += a;
    a = (a - c) ^ std::rotl(c, 16), c += b;
    b = (b - a) ^ std::rotl(a, 19), a += c;
    c = (c - b) ^ std::rotl(b, 4), b += a;
    bytes.remove_prefix(12);
  }
  if (bytes.empty()) return c;
  add(bytes);
  c = (c ^ b) - std::rotl(b, 14);
  a = (a ^ c) - std::rotl(c, 11);
  b = (b ^ a) - std::rotl(a, 25);
  c = (c ^ b) - std::rotl(b, 16);
  a = (a ^ c) - std::rotl(c, 4);
  b = (b ^ a) - std::rotl(a, 14);
  return (c ^ b) - std::rotl(b, 24);
}

bool renewChecksum(std::string_view whole, size_t begin, std::string& changed) {
  constexpr size_t kMin = 8, kMax = 4096;
  for (size_t bytes = kMin; bytes < kMax && begin + bytes + sizeof(uint32_t) <= whole.size(); ++bytes) {
    uint32_t stored = 0;
    std::memcpy(&stored, whole.data() + begin + bytes, sizeof stored);
    if (stored != hdf5Checksum(whole.substr(begin, bytes))) continue;
    const uint32_t renewed = hdf5Checksum(std::string_view(changed).substr(begin, bytes));
    std::memcpy(changed.data() + begin + bytes, &renewed, sizeof renewed);
    return true;
  }
  return false;
}

}  // namespace curvisplat
