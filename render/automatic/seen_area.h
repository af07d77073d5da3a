// The area in which a function shows something of the data.
#pragma once

#include <string_view>
#include <vector>

#include "render/automatic/coarse_samples.h"

namespace curvisplat {

/// The area, in world units squared, of the silhouette's parts in which something is seen from `view` (as Camera::named()
/// knows it): their optical depth is over 1 % of the silhouette's mean. `depths` [sample]: volume times extinction, not
/// negative; the unit does not matter. 0 if all are 0. Any thread.
double seenArea(const CoarseSamples& samples, std::string_view view, const std::vector<double>& depths);

}  // namespace curvisplat
