// How far splats reach: the extreme singular values of A, for supports and for the precision of positions.
#pragma once

#include <cstdint>
#include <span>

#include "stream/model/splats.h"

namespace curvisplat {

/// The largest singular value of A over `splats`: the longest half axis of the kernel's unit sphere. At most
/// 1e-6 too large, never too small. World units.
double largestSingularValue(std::span<const Splat> splats);

/// The smallest singular value of A over `splats`, 1e-6 too small at most, and too large by a ratio of 1 + `slack` at most:
/// some takes much less time. World units.
double smallestSingularValue(std::span<const Splat> splats, double slack = 0);

/// No splat's support, those of its parts at a border included, reaches further from its centre; 1e-6 too
/// large at most but for half cells. `border_codes`: as BrickSplats'. World units.
double largestReach(std::span<const Splat> splats, std::span<const uint32_t> border_codes);

}  // namespace curvisplat
