// From a pixel of the picture to the place in the data that is seen there.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "stream/cache/manifest.h"
#include "tools/viewer/frame_loop.h"

namespace curvisplat {

/// The point, in data coordinates, where the ray through `pixel` of a picture of `size` has half of its opacity.
/// nullopt where nothing is seen.
std::optional<glm::dvec3> pointSeenAt(const ShownValues& shown, const Manifest& manifest,
                                      const glm::dvec2& pixel, ImageSize size);

}  // namespace curvisplat
