// Opacities from a histogram: values that fill much of the volume are nearly clear, rare ones show.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "render/automatic/value_distribution.h"
#include "render/colour/opacity_curve.h"

namespace curvisplat {

using BinExtinctions = std::array<double, VolumeHistogram::kBins>;

/// Relative extinctions of the histogram's bins; the largest is 1. DESIGN.md, "The first picture".
BinExtinctions extinctionsOf(const VolumeHistogram& histogram);

/// The coordinates between which the middle 99 % of the volume lie, weighted by extinction.
std::pair<double, double> seenInterval(const VolumeHistogram& histogram, const BinExtinctions& extinctions);

/// The opacities over [begin, end] (coordinates of the histogram), for an opacity unit at which the largest
/// extinction has an optical depth of 2.3, by at most 24 points. Positions are 0..1 from begin to end.
std::vector<OpacityPoint> opacityPoints(const VolumeHistogram& histogram, const BinExtinctions& extinctions,
                                        double begin, double end);

}  // namespace curvisplat
