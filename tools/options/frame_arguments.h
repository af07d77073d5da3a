// How a frame looks, what it may use, and which values an EXR picture has beside its colours, as options
// state it. Shared by `render` and the Python package. The functions keep no state and need no cache: any
// thread may call them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "render/backend/pixel_values.h"
#include "render/frame/frame_options.h"
#include "render/image/image.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed by frameOptions().
struct FrameArguments {
  std::string size = "600x600", background = "dark";
  std::string classify = "pixel", scale = "1,1,1", memory = "512M";
  std::optional<std::string> card_memory;
  std::string lod_pixels = "1";
  std::optional<std::string> vertical_scale;  // verticallyScaled() in globe_arguments.h
  std::optional<std::string> clip_box, max_splats;
  std::vector<std::string> clip_planes;
  bool shade = false;
  std::optional<std::string> light, light_direction, shadow, ambient_occlusion, gradient_opacity;
  unsigned threads = 0;
  bool keep_going = false;
};

/// Throws UsageError with the option, what was found and what was expected.
FrameOptions frameOptions(const FrameArguments& arguments);

/// The values that an EXR picture has beside its colours (--channels).
struct ValueChannels {
  bool depth = false, normal = false, scalar = false;

  bool any() const { return depth || normal || scalar; }
  /// How many numbers each pixel has.
  size_t count() const { return (depth ? 1u : 0u) + (normal ? 3u : 0u) + (scalar ? 1u : 0u); }
};

/// The channels that --channels names; without it, the depth for an .exr file and none for others. Throws
/// UsageError.
ValueChannels valueChannels(const std::optional<std::string>& text, const std::filesystem::path& output);

/// The values as channels of a picture, whose left part they cover.
std::vector<ImageChannel> imageChannels(const ValueChannels& wanted, const PixelValues& values,
                                        ImageSize picture);

}  // namespace curvisplat
