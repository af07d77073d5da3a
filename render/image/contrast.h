// How much there is to see in a picture.
#pragma once

#include <glm/vec4.hpp>

#include "render/image/image.h"

namespace curvisplat {

/// Shares of a picture's pixels. Two colours are distinct if a channel differs by 0.1 or more.
struct PictureContrast {
  double seen = 0;   // distinct from the background
  double other = 0;  // of these, distinct from the most frequent colour among them too
};

/// `background`: premultiplied red, green, blue and alpha. Deterministic.
PictureContrast contrastOf(const Image& image, const glm::vec4& background);

}  // namespace curvisplat
