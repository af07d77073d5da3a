#include "preprocess/formats/cgns/adf_header.h"

#include <charconv>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// A number of digits in base 16; nullopt if it is none.
std::optional<uint64_t> hexadecimal(std::string_view digits) {
  uint64_t number = 0;
  const char* const end = digits.data() + digits.size();
  const auto [stop, error] = std::from_chars(digits.data(), end, number, 16);
  if (stop != end || error != std::errc()) return std::nullopt;
  return number;
}

/// An unsigned number in binary form, of either byte order.
std::optional<uint64_t> binary(std::string_view bytes, bool big_endian) {
  uint64_t number = 0;
  for (size_t n = 0; n < bytes.size(); ++n)
    number = number << 8 | static_cast<uint8_t>(bytes[big_endian ? n : bytes.size() - 1 - n]);
  return number;
}

/// The position of an ADF file's last byte; nullopt if its header has none. It is in the header's bytes 146 to
/// 157: a block of 4,096 bytes in eight bytes, and the byte in it in four. Version A has hexadecimal digits there,
/// version B numbers in the byte order that byte 100 names.
std::optional<uint64_t> lastByteOfAdf(std::string_view header) {
  constexpr size_t kVersion = 25, kOrder = 100, kEnd = 146, kOfBlock = 8, kOfByte = 4;
  constexpr uint64_t kBlock = 4096;
  const std::string_view in_block = header.substr(kEnd, kOfBlock),
                         in_byte = header.substr(kEnd + kOfBlock, kOfByte);
  const bool digits = header[kVersion] != 'B', big_endian = header[kOrder] == 'B';
  const auto block = digits ? hexadecimal(in_block) : binary(in_block, big_endian);
  const auto byte = digits ? hexadecimal(in_byte) : binary(in_byte, big_endian);
  if (!block || !byte || *block >= std::numeric_limits<uint64_t>::max() / kBlock / 2) return std::nullopt;
  return kBlock * *block + *byte;
}

}  // namespace

void requireWholeAdf(const InputFile& file) {
  constexpr size_t kHeader = 186;
  std::string header(kHeader, '\0');
  if (file.size() >= kHeader) file.readAt(0, std::span(header.data(), header.size()));
  const auto last = lastByteOfAdf(header);
  if (!last || *last < kHeader)
    throw Error("{}: its ADF header has no position of its end; the file is damaged: copy or write it again",
                file.path().string());
  if (*last >= file.size())
    throw Error("{}: is truncated (found {} bytes, expected {}); copy or write it again",
                file.path().string(), file.size(), *last + 1);
}

}  // namespace curvisplat
