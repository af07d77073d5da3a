#include "render/image/image_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

struct Format {
  std::string_view ending;
  std::string_view magic;
  Bytes (*encode)(const Image&);
  uint64_t pixel_bytes;  // of memory that encoding needs for each pixel, the encoded file included
  Image (*decode)(std::span<const std::byte>, const std::string&);
  ImageSize (*size)(std::span<const std::byte>, const std::string&);
};

constexpr std::array<Format, 5> kFormats{{
    {".png", "\x89PNG", encodePng, 8, decodePng, sizeOfPng},
    {".exr", "\x76\x2f\x31\x01", encodeExr, 48, decodeExr, sizeOfExr},
    {".pfm", "PF", encodePfm, 12, decodePfm, sizeOfPfm},
    {"", "Pf", nullptr, 0, decodePfm, sizeOfPfm},  // greyscale: read, never written
    {"", "\xff\xd8\xff", nullptr, 0, decodeJpeg, sizeOfJpeg},
}};

constexpr size_t kLongestHeader = size_t{4} << 20;    // profiles and small pictures may come first
constexpr uint64_t kLargestFile = uint64_t{8} << 30;  // 16384 x 16384 pixels of four floats are 4 GiB

/// nullptr: none has this ending.
const Format* findFormat(const std::string& ending) {
  for (const Format& format : kFormats)
    if (format.encode != nullptr && ending == format.ending) return &format;
  return nullptr;
}

const Format& formatByName(const std::filesystem::path& path) {
  const std::string ending = extensionOf(path);
  if (const Format* const format = findFormat(ending)) return *format;
  throw UsageError("{}: unknown image format{}; the name must end in .png, .exr or .pfm", path.string(),
                   didYouMean(ending, std::vector<std::string>{".png", ".exr", ".pfm"}));
}

}  // namespace

bool isImageName(const std::filesystem::path& path) {
  return findFormat(extensionOf(path)) != nullptr;
}

void checkImageSize(uint64_t width, uint64_t height, const std::filesystem::path& path) {
  constexpr auto kMax = static_cast<uint64_t>(kLargestImageSide);
  if (width == 0 || height == 0 || width > kMax || height > kMax)
    throw UsageError("{}: the picture has {} x {} pixels; expected 1 to {} on each side", path.string(),
                     width, height, kMax);
}

namespace {

void requireWritable(ImageSize size, const std::filesystem::path& path) {
  checkImageSize(static_cast<uint64_t>(std::max(0, size.width)),
                 static_cast<uint64_t>(std::max(0, size.height)), path);
}

}  // namespace

void writeImage(const Image& image, const std::filesystem::path& path) {
  requireWritable(image.size, path);
  writeFileDurably(path, formatByName(path).encode(image));
}

void writeExr(const Image& image, std::span<const ImageChannel> more, const std::filesystem::path& path) {
  requireWritable(image.size, path);
  writeFileDurably(path, encodeExr(image, more));
}

namespace {

void requireReadable(const InputFile& file, const std::filesystem::path& path) {
  if (file.size() > kLargestFile)
    throw Error("{}: has {} bytes; image files of at most {} bytes are read", path.string(), file.size(),
                kLargestFile);
}

}  // namespace

std::vector<ImageChannel> readChannels(const std::filesystem::path& path) {
  const InputFile file(path);
  requireReadable(file, path);
  Bytes bytes(file.size());
  file.readAt(0, std::span(bytes));
  return decodeExrChannels(bytes, path.string());
}

uint64_t writingBytes(const std::filesystem::path& path, ImageSize size) {
  return formatByName(path).pixel_bytes * size.pixels();
}

void checkImageName(const std::filesystem::path& path) {
  formatByName(path);
}

namespace {

const Format& formatOf(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  for (const Format& format : kFormats)
    if (bytes.size() >= format.magic.size() &&
        std::memcmp(bytes.data(), format.magic.data(), format.magic.size()) == 0)
      return format;
  throw Error("{}: not a PNG, JPEG, EXR or PFM image (by its first bytes)", path.string());
}

Bytes firstBytes(const InputFile& file, uint64_t most) {
  Bytes bytes(std::min<uint64_t>(file.size(), most));
  file.readAt(0, std::span(bytes));
  return bytes;
}

}  // namespace

ImageSize readImageSize(const std::filesystem::path& path) {
  const Bytes bytes = firstBytes(InputFile(path), kLongestHeader);
  const ImageSize size = formatOf(bytes, path).size(bytes, path.string());
  requirePossibleSize(size.width, size.height, path.string());
  return size;
}

Image readImage(const std::filesystem::path& path) {
  constexpr size_t kLongestMagic = 4;
  const InputFile file(path);
  const Format& format = formatOf(firstBytes(file, kLongestMagic), path);
  requireReadable(file, path);
  return format.decode(firstBytes(file, file.size()), path.string());
}

std::string limitOfHeader(std::span<const std::byte> bytes) {
  if (bytes.size() != kLongestHeader) return {};
  return fmt::format(" (headers of at most {} bytes are read)", kLongestHeader);
}

void requirePossibleSize(int64_t width, int64_t height, const std::string& name) {
  if (width < 1 || height < 1 || width > kLargestImageSide || height > kLargestImageSide)
    throw Error("{}: claims {} x {} pixels, expected 1 to {} on each side", name, width, height,
                kLargestImageSide);
}

void requirePlausibleSize(int64_t width, int64_t height, uint64_t bytes_per_pixel, uint64_t packed_bytes,
                          uint64_t largest_ratio, const std::string& name) {
  requirePossibleSize(width, height, name);
  const uint64_t image_bytes = static_cast<uint64_t>(width) * static_cast<uint64_t>(height) * bytes_per_pixel;
  if (image_bytes / largest_ratio > packed_bytes)
    throw Error("{}: claims {} x {} pixels, which its {} bytes cannot hold; the file is truncated or corrupt",
                name, width, height, packed_bytes);
}

uint8_t toByte(float value) {
  if (!(value > 0)) return 0;  // NaN too
  return static_cast<uint8_t>(std::min(value, 1.0f) * 255 + 0.5f);
}

bool isOpaque(const Image& image) {
  for (size_t n = 3; n < image.rgba.size(); n += 4)
    if (image.rgba[n] != 1) return false;
  return true;
}

// Portable float maps:
//
//   "PF" (colour) or "Pf" (grey), width, height, scale      as text, each followed by one white-space byte
//   rows from the bottom up, 32-bit floats                  little-endian if the scale is negative

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

namespace {

struct PfmHeader {
  int channels, width, height;
  double scale;
  size_t bytes;
};

PfmHeader headerOfPfm(std::span<const std::byte> bytes, const std::string& name) {
  const size_t longest_header = std::min<size_t>(bytes.size(), 256);
  HeaderWords words({reinterpret_cast<const char*>(bytes.data()), longest_header}, name);
  const int channels = words.next() == "PF" ? 3 : 1;
  const auto width = words.nextNumber<int>("width"), height = words.nextNumber<int>("height");
  const auto scale = words.nextNumber<double>("scale");
  if (!std::isfinite(scale) || scale == 0)
    throw Error("{}: the PFM header has the scale {}; expected a finite number other than 0", name, scale);
  return {channels, width, height, scale, words.at()};
}

}  // namespace

ImageSize sizeOfPfm(std::span<const std::byte> bytes, const std::string& name) {
  const PfmHeader header = headerOfPfm(bytes, name);
  return {header.width, header.height};
}

Image decodePfm(std::span<const std::byte> bytes, const std::string& name) {
  const auto [channels, width, height, scale, header_bytes] = headerOfPfm(bytes, name);
  const uint64_t found = bytes.size() - header_bytes;
  requirePlausibleSize(width, height, 4 * channels, found, 1, name);
  const uint64_t expected = 4ull * channels * width * height;
  if (found != expected)
    throw Error("{}: {} x {} pixels of {} channels need {} bytes after the header, found {}", name, width,
                height, channels, expected, found);

  Image image({width, height});
  const std::byte* from = bytes.data() + header_bytes;
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
