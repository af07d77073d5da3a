#include "render/automatic/seen_area.h"

#include <numeric>

#include "render/automatic/pixel_sums.h"

namespace curvisplat {

double seenArea(const CoarseSamples& samples, std::string_view view, const std::vector<double>& depths) {
  constexpr double kSeenPart = 0.01;  // of the mean depth
  if (samples.size() == 0) return 0;
  const PixelSums pixels(samples, view);
  const double covered = pixels.coveredArea();
  if (!(covered > 0)) return 0;
  const auto sums = pixels.of([&](size_t n) { return depths[n]; });
  const double mean = std::accumulate(sums.begin(), sums.end(), 0.0) * pixels.pixelArea() / covered;
  return pixels.areaOver(kSeenPart * mean, sums);
}

}  // namespace curvisplat
