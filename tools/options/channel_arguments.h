// --channels: what an EXR picture has beside its colours.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "render/frame/pixel_values.h"
#include "render/image/image_channel.h"

namespace curvisplat {

struct ValueChannels {
  bool depth = false, normal = false, scalar = false;

  bool any() const { return depth || normal || scalar; }
  /// Numbers a pixel.
  size_t count() const { return (depth ? 1u : 0u) + (normal ? 3u : 0u) + (scalar ? 1u : 0u); }
};

/// By --channels; of an .exr file without it: the depth. Throws UsageError.
ValueChannels valueChannels(const std::optional<std::string>& text, const std::filesystem::path& output);

/// As channels of a picture, of which the values are the left part.
std::vector<ImageChannel> imageChannels(const ValueChannels& wanted, const PixelValues& values,
                                        ImageSize picture);

}  // namespace curvisplat
