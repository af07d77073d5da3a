// The size of an image, in pixels.
#pragma once

#include <cstdint>

namespace curvisplat {

struct ImageSize {
  int width = 600;
  int height = 600;

  bool operator==(const ImageSize&) const = default;
  uint64_t pixels() const { return static_cast<uint64_t>(width) * static_cast<uint64_t>(height); }
};

}  // namespace curvisplat
