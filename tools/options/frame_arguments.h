// How a frame looks and what it may use, as options state it: shared by `render` and the Python package.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "render/frame/frame_options.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed by frameOptions().
struct FrameArguments {
  std::string size = "600x600", background = "white";
  std::string classify = "pixel", scale = "1,1,1", memory = "512M";
  std::string lod_pixels = "1";
  std::optional<std::string> clip_box, max_splats;
  std::vector<std::string> clip_planes;
  bool shade = false;
  std::optional<std::string> light, light_direction;
  unsigned threads = 0;
  bool keep_going = false;
};

/// Throws UsageError with the option, what was found and what was expected.
FrameOptions frameOptions(const FrameArguments& arguments);

}  // namespace curvisplat
