#include "preprocess/formats/common/hdf5_end.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string_view>

namespace curvisplat {
namespace {

// 8 bytes of signature and the version, then
//
//   version 0    24 bytes in all, of which the 14th tells how long addresses are; base, free space, END
//   version 1    28 bytes in all, otherwise the same
//   2 and 3      12 bytes in all, of which the 10th tells how long addresses are; base, extension, END
constexpr size_t kLooked = 64;

/// nullopt if `begin` is not that of an HDF5 file, or of a version that is not known.
std::optional<uint64_t> statedEnd(const std::array<uint8_t, kLooked>& begin) {
  constexpr std::string_view kSignature = "\x89HDF\r\n\x1a\n";
  if (!std::equal(kSignature.begin(), kSignature.end(), begin.begin(),
                  [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; }))
    return std::nullopt;
  const uint8_t version = begin[8];
  if (version > 3) return std::nullopt;
  const size_t address_bytes = begin[version < 2 ? 13 : 9], head = version < 2 ? 24 + 4u * version : 12;
  if (address_bytes != 4 && address_bytes != 8) return std::nullopt;
  const auto address = [&](size_t number) {
    uint64_t value = 0;
    for (size_t n = address_bytes; n-- > 0;) value = value << 8 | begin[head + number * address_bytes + n];
    return value;
  };
  return address(0) == 0 ? std::optional(address(2)) : std::nullopt;
}

}  // namespace

void requireWholeHdf5(const InputFile& file) {
  std::array<uint8_t, kLooked> begin{};
  file.readAt(0, std::span(begin).first(std::min<uint64_t>(begin.size(), file.size())));
  if (const auto end = statedEnd(begin); end && *end > file.size())
    throw TruncatedFile("{}: is truncated (found {} bytes, expected {}); copy it again", file.path().string(),
                        file.size(), *end);
}

}  // namespace curvisplat
