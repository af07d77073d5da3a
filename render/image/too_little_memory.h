// The error of a picture that does not fit into its memory. Whoever cannot give more may draw the picture with fewer pixels.
#pragma once

#include <cstdint>
#include <string>

#include "render/image/image.h"
#include "stream/base/error.h"

namespace curvisplat {

/// Thrown if a picture does not fit into its memory.
class TooLittleMemory : public UsageError {
 public:
  /// `least`: bytes that suffice for all parts of the picture that are known by then; 0 if none are.
  TooLittleMemory(const std::string& text, ImageSize picture, uint64_t least = 0)
      : UsageError("{}", text), least_bytes(least), size(picture) {}

  uint64_t least_bytes;
  ImageSize size;
};

}  // namespace curvisplat
