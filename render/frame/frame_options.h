// What a frame is to look like, and what it may take.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <vector>

#include "render/image/image_size.h"
#include "render/project/projection.h"
#include "render/project/screen_view.h"
#include "stream/paging/pager.h"

namespace curvisplat {

enum class Classification { kPixel, kFlat };  // flat: one colour and extinction a splat, as in the paper

struct FrameOptions {
  ImageSize size;
  Classification classification = Classification::kPixel;
  double lod_pixels = 1;               // screen-space error allowed; 0 is the finest level
  std::optional<uint64_t> max_splats;  // read at most these, from the levels that make the best of them
  glm::dvec3 scale{1.0};               // stretches the data: D S Dᵀ, V det D, about the world's origin
  std::optional<WorldBox> clip_box;    // nothing is drawn outside
  std::vector<ClipPlane> clip_planes;  // nor on their outer sides
  std::optional<Light> light;          // none: colours are those of the transfer function
  glm::vec4 background{1, 1, 1, 1};    // premultiplied
  double low_pass_px2 = kLowPass;      // added to S2's diagonal
  unsigned threads = 0;                // workers; 0: one a core
  uint64_t memory_bytes = 512 << 20;
  uint64_t output_bytes = 0;  // of memory_bytes: left for what is done with the image
  bool keep_going = false;    // draw damaged bricks from an ancestor, and report them
  PagerOptions::Way read_by = PagerOptions::Way::kAutomatic;
  bool direct_reads = true;  // past the page cache, where the file system can
};

}  // namespace curvisplat
