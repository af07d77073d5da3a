#include "render/image/image_formats.h"

#include <algorithm>

#include "stream/base/error.h"

namespace curvisplat {

void requirePlausibleSize(int64_t width, int64_t height, uint64_t bytes_per_pixel, uint64_t packed_bytes,
                          uint64_t largest_ratio, const std::string& name) {
  if (width < 1 || height < 1 || width > kLargestImageSide || height > kLargestImageSide)
    throw Error("{}: claims {} x {} pixels, expected 1 to {} on each side", name, width, height,
                kLargestImageSide);
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

}  // namespace curvisplat
