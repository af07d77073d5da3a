#include "preprocess/formats/vtk/base64_bytes.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kPieceCharacters = size_t{16} << 10;  // a multiple of 4
constexpr uint8_t kNone = 64, kPadding = 65;

constexpr std::array<uint8_t, 256> valuesOfCharacters() {
  constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<uint8_t, 256> values{};
  values.fill(kNone);
  for (size_t n = 0; n < kAlphabet.size(); ++n)
    values[static_cast<uint8_t>(kAlphabet[n])] = static_cast<uint8_t>(n);
  values['='] = kPadding;
  return values;
}
constexpr std::array<uint8_t, 256> kValues = valuesOfCharacters();

/// Decodes a group of four characters. Returns the number of bytes (1 to 3), or 0 if they are not base64.
size_t decodeFour(const std::byte* from, std::array<std::byte, 3>& to) {
  std::array<uint32_t, 4> values;
  for (size_t n = 0; n < 4; ++n) values[n] = kValues[static_cast<uint8_t>(from[n])];
  size_t bytes = 3;
  if (values[3] == kPadding) {
    bytes = 2;
    values[3] = 0;
    if (values[2] == kPadding) {
      bytes = 1;
      values[2] = 0;
    }
  }
  if ((values[0] | values[1] | values[2] | values[3]) >= kNone) return 0;
  const uint32_t bits = values[0] << 18 | values[1] << 12 | values[2] << 6 | values[3];
  to = {std::byte(bits >> 16), std::byte(bits >> 8 & 255), std::byte(bits & 255)};
  return bytes;
}

}  // namespace

Base64Bytes::Base64Bytes(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end)
    : file_(std::move(file)),
      begin_(std::min(begin, file_->size())),
      characters_(std::max(std::min(end, file_->size()), begin_) - begin_) {}

void Base64Bytes::readAt(uint64_t offset, std::span<std::byte> to) const {
  std::array<std::byte, kPieceCharacters> text;
  uint64_t four = offset / 3;
  auto skipped = static_cast<size_t>(offset % 3);
  while (!to.empty()) {
    const uint64_t wanted = (skipped + to.size() + 2) / 3;
    const uint64_t left = characters_ / 4 - std::min(four, characters_ / 4);
    const auto fours = static_cast<size_t>(std::min({wanted, left, uint64_t{kPieceCharacters / 4}}));
    if (fours == 0)
      throw Error("{}: byte {}: expected {} more bytes in base64; the file is truncated or damaged",
                  file_->name(), begin_ + 4 * four, to.size());
    file_->readAt(begin_ + 4 * four, std::span(text).first(4 * fours));
    for (size_t n = 0; n < fours && !to.empty(); ++n) {
      std::array<std::byte, 3> bytes;
      const size_t count = decodeFour(&text[4 * n], bytes);
      const size_t used = std::min(3 - skipped, to.size());
      if (count < skipped + used)
        throw Error("{}: byte {}: {}; the file is damaged", file_->name(), begin_ + 4 * (four + n),
                    count == 0 ? "not valid base64" : "the base64 ends before the end of its data");
      std::copy_n(&bytes[skipped], used, to.begin());
      to = to.subspan(used);
      skipped = 0;
    }
    four += fours;
  }
}

bool Base64Bytes::endsWith(uint64_t bytes) const {
  const uint64_t last = (bytes - 1) / 3;
  if (last >= characters_ / 4) return false;
  std::byte character;
  file_->readAt(begin_ + 4 * last + 3, std::span(&character, 1));
  return character == std::byte{'='};
}

std::shared_ptr<const Base64Bytes> Base64Bytes::behind(uint64_t bytes) const {
  const uint64_t fours = std::min((bytes + 2) / 3, characters_ / 4);
  return std::make_shared<const Base64Bytes>(file_, begin_ + 4 * fours, begin_ + characters_);
}

}  // namespace curvisplat
