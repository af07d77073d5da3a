#include "render/image.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "render/image_formats.h"
#include "stream/error.h"
#include "stream/file.h"

namespace curvisplat {
namespace {

struct Format {
  std::string_view ending;
  std::string_view magic;
  Bytes (*encode)(const Image&);
  uint64_t pixel_bytes;  // that encoding takes for a pixel, the file included
  Image (*decode)(std::span<const std::byte>, const std::string&);
};

constexpr std::array<Format, 4> kFormats{{
    {".png", "\x89PNG", encodePng, 8, decodePng},
    {".exr", "\x76\x2f\x31\x01", encodeExr, 48, decodeExr},
    {".pfm", "PF", encodePfm, 12, decodePfm},
    {"", "Pf", nullptr, 0, decodePfm},  // one grey channel: read, never written
}};

constexpr size_t kLongestMagic = 4;
constexpr uint64_t kLargestFile = uint64_t{8} << 30;  // 16384 x 16384 pixels of four floats are 4 GiB

const Format& formatByName(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const Format& format : kFormats)
    if (format.encode != nullptr && ending == format.ending) return format;
  throw UsageError("{}: an image's name ends in .png, .exr or .pfm", path.string());
}

// Red, green or blue over white.
double overWhite(const float* pixel, int channel) {
  return static_cast<double>(pixel[channel]) + (1 - static_cast<double>(pixel[3]));
}

}  // namespace

Image::Image(ImageSize size_) : size(size_), rgba(4 * size_.pixels()) {}

void writeImage(const Image& image, const std::filesystem::path& path) {
  CURVISPLAT_CHECK(image.size.width > 0 && image.size.width <= kLargestImageSide);
  CURVISPLAT_CHECK(image.size.height > 0 && image.size.height <= kLargestImageSide);
  writeFileDurably(path, formatByName(path).encode(image));
}

uint64_t writingBytes(const std::filesystem::path& path, ImageSize size) {
  return formatByName(path).pixel_bytes * size.pixels();
}

void checkImageName(const std::filesystem::path& path) {
  formatByName(path);
}

Image readImage(const std::filesystem::path& path) {
  const InputFile file(path);
  Bytes bytes(std::min<uint64_t>(file.size(), kLongestMagic));
  file.readAt(0, std::span(bytes));
  for (const Format& format : kFormats) {
    if (bytes.size() < format.magic.size() ||
        std::memcmp(bytes.data(), format.magic.data(), format.magic.size()) != 0)
      continue;
    if (file.size() > kLargestFile)
      throw Error("{}: has {} bytes, more than the {} an image can have", path.string(), file.size(),
                  kLargestFile);
    bytes.resize(file.size());
    file.readAt(0, std::span(bytes));
    return format.decode(bytes, path.string());
  }
  throw Error("{}: is not a PNG, EXR or PFM image, by its first bytes", path.string());
}

ImageDifference compareImages(const Image& a, const Image& b) {
  if (a.size.width != b.size.width || a.size.height != b.size.height)
    throw Error("the images have different sizes: {} x {} and {} x {} pixels", a.size.width, a.size.height,
                b.size.width, b.size.height);
  ImageDifference difference;
  double sum = 0;
  for (int y = 0; y < a.size.height; ++y)
    for (int x = 0; x < a.size.width; ++x)
      for (int channel = 0; channel < 3; ++channel) {
        const double d = std::abs(overWhite(a.pixel(x, y), channel) - overWhite(b.pixel(x, y), channel));
        if (!std::isfinite(d)) throw Error("pixel ({}, {}) of one of the images is not finite", x, y);
        sum += d * d;
        if (d > difference.largest) {
          difference.largest = d;
          difference.largest_x = x;
          difference.largest_y = y;
        }
      }
  const double values = 3.0 * a.size.width * a.size.height;
  difference.psnr_db = sum > 0 ? -10 * std::log10(sum / values) : std::numeric_limits<double>::infinity();
  return difference;
}

void requirePlausibleSize(int64_t width, int64_t height, uint64_t bytes_per_pixel, uint64_t packed_bytes,
                          uint64_t largest_ratio, const std::string& name) {
  if (width < 1 || height < 1 || width > kLargestImageSide || height > kLargestImageSide)
    throw Error("{}: says that it has {} x {} pixels, and 1 to {} were expected a side", name, width, height,
                kLargestImageSide);
  const uint64_t image_bytes = static_cast<uint64_t>(width) * static_cast<uint64_t>(height) * bytes_per_pixel;
  if (image_bytes / largest_ratio > packed_bytes)
    throw Error(
        "{}: says that it has {} x {} pixels, which do not fit its {} bytes; it is truncated or corrupt",
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

}  // namespace curvisplat
