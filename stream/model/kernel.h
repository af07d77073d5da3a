// The numbers of the reconstruction kernel K(r), in units of a cell, which conversion, cache and drawing
// share. DESIGN.md, "Splats"; render/project/footprint.h has the kernel itself.
#pragma once

namespace curvisplat {

inline constexpr double kKernelSupport = 1.556228;  // K is zero from here on
inline constexpr double kKernelSigma = 0.44655;     // standard deviation along an axis

}  // namespace curvisplat
