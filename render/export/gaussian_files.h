// Files of 3D Gaussian splats, as web viewers read them.
#pragma once

#include <filesystem>
#include <span>

#include "render/export/gaussian_splats.h"

namespace curvisplat {

/// Throws UsageError for a name that writeGaussians() would refuse.
void checkGaussianName(const std::filesystem::path& path);

/// Writes what the name's ending asks for. The file appears whole or not at all. Throws UsageError for
/// another ending, Error if the file cannot be written.
///
///   .ply   the published layout (Kerbl et al., 2023) without the colours that depend on the view: position,
///          normal (zero), f_dc (colour), opacity (logit), scale (logarithm), rot (w, x, y, z); 68 bytes a
///          splat
///   .spz   Niantic's packed format, version 2, compressed with gzip: positions to 1/4096 of a unit, scales
///          in steps of 6 %; about 16 bytes a splat. Positions are shifted and scaled to fit, see `SpzFrame`
///   .glb   binary glTF with KHR_gaussian_splatting; lengths and opacities (0..1) as they are, with colours
///          for viewers that draw points only. z becomes glTF's y, which is up; 60 bytes a splat, 4 GiB at
///          most
void writeGaussians(std::span<const GaussianSplat> splats, const std::filesystem::path& path);

/// How .spz files are scaled: a position p is stored as (p - centre) * scale, so that the data's box is
/// 1,000 units wide.
struct SpzFrame {
  glm::dvec3 centre{0.0};
  double scale = 1;
};
SpzFrame spzFrameOf(std::span<const GaussianSplat> splats);

}  // namespace curvisplat
