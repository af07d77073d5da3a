// Brings the tiles that ranks have drawn together at rank 0.
#pragma once

#include <cstdint>
#include <vector>

#include "render/image/image.h"
#include "stream/base/ranks.h"

namespace curvisplat {

/// `owners` [tile]: its rank. Completes the image at rank 0; all have to call it. Takes 16 bytes a pixel there.
void joinTiles(Image& image, const std::vector<uint32_t>& owners, Ranks& ranks);

}  // namespace curvisplat
