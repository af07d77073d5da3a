// Portable float maps:
//
//   "PF" (colour) or "Pf" (grey), width, height, scale      as text, each followed by one white-space byte
//   rows from the bottom up, 32-bit floats                  little-endian if the scale is negative
#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string_view>

#include "render/image/image_formats.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// Reads the words of the header: skips white space before a word and takes one byte of it after the word.
class HeaderWords {
 public:
  HeaderWords(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  std::string_view next() {
    while (at_ < text_.size() && isSpace(text_[at_])) ++at_;
    const size_t begin = at_;
    while (at_ < text_.size() && !isSpace(text_[at_])) ++at_;
    if (at_ == text_.size()) throw Error("{}: the PFM header is truncated", name_);
    return text_.substr(begin, at_++ - begin);
  }
  template <typename Number>
  Number nextNumber(const char* what) {
    const std::string_view word = next();
    Number number{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (error != std::errc() || end != word.data() + word.size())
      throw Error("{}: the PFM header has '{}' for its {}", name_, word, what);
    return number;
  }
  size_t at() const { return at_; }

 private:
  static bool isSpace(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

  std::string_view text_;
  const std::string& name_;
  size_t at_ = 0;
};

float loadFloat(const std::byte* from, bool little_endian) {
  std::array<std::byte, 4> bytes;
  std::memcpy(bytes.data(), from, 4);
  if (little_endian != (std::endian::native == std::endian::little)) std::reverse(bytes.begin(), bytes.end());
  return std::bit_cast<float>(bytes);
}

}  // namespace

Bytes encodePfm(const Image& image) {
  static_assert(std::endian::native == std::endian::little, "the scale of -1 says so");
  const std::string header = fmt::format("PF\n{} {}\n-1.0\n", image.size.width, image.size.height);
  const size_t row_bytes = 3 * sizeof(float) * static_cast<size_t>(image.size.width);
  Bytes bytes(header.size() + row_bytes * static_cast<size_t>(image.size.height));
  std::memcpy(bytes.data(), header.data(), header.size());
  std::byte* to = bytes.data() + header.size();
  for (int y = image.size.height - 1; y >= 0; --y)
    for (int x = 0; x < image.size.width; ++x, to += 3 * sizeof(float))
      std::memcpy(to, image.pixel(x, y), 3 * sizeof(float));
  return bytes;
}

Image decodePfm(std::span<const std::byte> bytes, const std::string& name) {
  const size_t longest_header = std::min<size_t>(bytes.size(), 256);
  HeaderWords words({reinterpret_cast<const char*>(bytes.data()), longest_header}, name);
  const int channels = words.next() == "PF" ? 3 : 1;
  const auto width = words.nextNumber<int>("width"), height = words.nextNumber<int>("height");
  const auto scale = words.nextNumber<double>("scale");
  if (!std::isfinite(scale) || scale == 0)
    throw Error("{}: the PFM header has the scale {}; expected a finite number other than 0", name, scale);

  const uint64_t found = bytes.size() - words.at();
  requirePlausibleSize(width, height, 4 * channels, found, 1, name);
  const uint64_t expected = 4ull * channels * width * height;
  if (found != expected)
    throw Error("{}: {} x {} pixels of {} channels need {} bytes after the header, found {}", name, width,
                height, channels, expected, found);

  Image image({width, height});
  const std::byte* from = bytes.data() + words.at();
  for (int y = height - 1; y >= 0; --y)
    for (int x = 0; x < width; ++x) {
      float* pixel = image.pixel(x, y);
      for (int c = 0; c < channels; ++c, from += 4) pixel[c] = loadFloat(from, scale < 0);
      if (channels == 1) pixel[1] = pixel[2] = pixel[0];
      pixel[3] = 1;
    }
  return image;
}

}  // namespace curvisplat
