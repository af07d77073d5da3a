// Draws 3D Gaussian splats as their viewers do, to compare the pictures with ours: sorted by their centres, each
// o exp(-q/2) over those behind it, its ellipse widened by 0.3 pixels² against aliasing.
#pragma once

#include <span>

#include "render/camera/camera.h"
#include "render/export/gaussian_splats.h"
#include "render/image/image.h"

namespace curvisplat {

/// Over white, orthographic cameras only (UsageError for others). One thread; about 0.3 us a splat and 4 ns a pixel that it covers.
Image drawGaussians(std::span<const GaussianSplat> splats, const Camera& camera, ImageSize size);

}  // namespace curvisplat
