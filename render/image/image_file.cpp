#include "render/image/image_file.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "render/image/image_formats.h"
#include "stream/base/check.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/paths.h"
#include "stream/base/suggestion.h"

namespace curvisplat {
namespace {

struct Format {
  std::string_view ending;
  std::string_view magic;
  Bytes (*encode)(const Image&);
  uint64_t pixel_bytes;  // of memory that encoding needs for each pixel, the encoded file included
  Image (*decode)(std::span<const std::byte>, const std::string&);
};

constexpr std::array<Format, 4> kFormats{{
    {".png", "\x89PNG", encodePng, 8, decodePng},
    {".exr", "\x76\x2f\x31\x01", encodeExr, 48, decodeExr},
    {".pfm", "PF", encodePfm, 12, decodePfm},
    {"", "Pf", nullptr, 0, decodePfm},  // greyscale: read, never written
}};

constexpr size_t kLongestMagic = 4;
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

void writeImage(const Image& image, const std::filesystem::path& path) {
  CURVISPLAT_CHECK(image.size.width > 0 && image.size.width <= kLargestImageSide);
  CURVISPLAT_CHECK(image.size.height > 0 && image.size.height <= kLargestImageSide);
  writeFileDurably(path, formatByName(path).encode(image));
}

void writeExr(const Image& image, std::span<const ImageChannel> more, const std::filesystem::path& path) {
  CURVISPLAT_CHECK(image.size.width > 0 && image.size.width <= kLargestImageSide);
  CURVISPLAT_CHECK(image.size.height > 0 && image.size.height <= kLargestImageSide);
  writeFileDurably(path, encodeExr(image, more));
}

std::vector<ImageChannel> readChannels(const std::filesystem::path& path) {
  const InputFile file(path);
  if (file.size() > kLargestFile)
    throw Error("{}: has {} bytes; image files of at most {} bytes are read", path.string(), file.size(),
                kLargestFile);
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

Image readImage(const std::filesystem::path& path) {
  const InputFile file(path);
  Bytes bytes(std::min<uint64_t>(file.size(), kLongestMagic));
  file.readAt(0, std::span(bytes));
  for (const Format& format : kFormats) {
    if (bytes.size() < format.magic.size() ||
        std::memcmp(bytes.data(), format.magic.data(), format.magic.size()) != 0)
      continue;
    if (file.size() > kLargestFile)
      throw Error("{}: has {} bytes; image files of at most {} bytes are read", path.string(), file.size(),
                  kLargestFile);
    bytes.resize(file.size());
    file.readAt(0, std::span(bytes));
    return format.decode(bytes, path.string());
  }
  throw Error("{}: not a PNG, EXR or PFM image (by its first bytes)", path.string());
}

}  // namespace curvisplat
