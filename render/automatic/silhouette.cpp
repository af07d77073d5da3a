#include "render/automatic/silhouette.h"

#include "render/automatic/pixel_sums.h"

namespace curvisplat {
namespace {

constexpr double kPreferIso = 1.15, kPreferEarlier = 1.03;
constexpr std::string_view kViews[] = {"iso", "+x", "-x", "+y", "-y", "+z", "-z"};

}  // namespace

Silhouette widestSilhouette(const CoarseSamples& samples) {
  if (samples.size() == 0) return {"iso", 0};
  Silhouette best{"iso", 0};
  for (const std::string_view view : kViews) {
    const double area = PixelSums(samples, view).coveredArea();
    if (view == "iso" || area > best.area * (best.view == "iso" ? kPreferIso : kPreferEarlier))
      best = {view, area};
  }
  return best;
}

}  // namespace curvisplat
