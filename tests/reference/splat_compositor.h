// The specification of the painters: screen splats drawn one after the other in double precision, with the
// footprint and the classification evaluated, not looked up. Slow, and right.
#pragma once

#include <glm/vec4.hpp>
#include <span>

#include "render/colour/classification.h"
#include "render/image/image.h"
#include "render/project/painter.h"
#include "render/project/screen_splat.h"

namespace curvisplat {

/// Blends `splats` over `background` (premultiplied) in their order.
Image compositeSplats(std::span<const ScreenSplat> splats, const ClassificationTable& table,
                      PixelShading shading, ImageSize size, const glm::vec4& background);

}  // namespace curvisplat
