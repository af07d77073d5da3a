// 3D Gaussian splats as binary glTF with the extension KHR_gaussian_splatting.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "render/export/gaussian_splats.h"

namespace curvisplat {

/// The file's bytes. Scales are lengths and opacities 0..1, other than in .ply; 60 bytes a splat, with colours for viewers that
/// draw points only. glTF's y axis is up: positions and axes are turned so that our z is. Throws Error if the file would
/// have 4 GiB or more, which glTF cannot say.
std::vector<std::byte> glbOf(std::span<const GaussianSplat> splats);

}  // namespace curvisplat
