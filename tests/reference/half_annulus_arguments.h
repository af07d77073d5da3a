// The arguments of `render` for the picture of the half-annulus in DESIGN.md, "Fidelity".
#pragma once

#include <string>
#include <vector>

#include "render/camera/camera.h"

namespace curvisplat {

/// Draws the cache with the test data's function half_annulus_<function>.json, every pixel classified, over
/// white.
std::vector<std::string> halfAnnulusWords(const std::string& cache, const std::string& output,
                                          const std::string& function, ImageSize size,
                                          const std::string& lod_pixels);

}  // namespace curvisplat
