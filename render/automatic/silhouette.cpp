#include "render/automatic/silhouette.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <limits>

#include "render/camera/camera.h"

namespace curvisplat {
namespace {

constexpr int kPixels = 80;  // of the longer side: some 50 samples for each pixel
constexpr double kPreferIso = 1.15, kPreferEarlier = 1.03;
constexpr std::string_view kViews[] = {"iso", "+x", "-x", "+y", "-y", "+z", "-z"};

double areaFrom(const CoarseSamples& samples, const glm::dmat4& view_from_world) {
  glm::dvec2 lower(std::numeric_limits<double>::max()), upper(-std::numeric_limits<double>::max());
  std::vector<glm::dvec2> places(samples.size());
  for (size_t n = 0; n < samples.size(); ++n) {
    places[n] = glm::dvec2(view_from_world * glm::dvec4(samples.positions[n], 1));
    lower = glm::min(lower, places[n]);
    upper = glm::max(upper, places[n]);
  }
  const double pixel = std::max(upper.x - lower.x, upper.y - lower.y) / kPixels;
  if (!(pixel > 0)) return 0;
  std::vector<char> covered(size_t{kPixels} * kPixels, 0);
  for (const glm::dvec2& place : places) {
    const auto column = std::min(kPixels - 1, static_cast<int>((place.x - lower.x) / pixel));
    const auto row = std::min(kPixels - 1, static_cast<int>((place.y - lower.y) / pixel));
    covered[static_cast<size_t>(row) * kPixels + static_cast<size_t>(column)] = 1;
  }
  return static_cast<double>(std::count(covered.begin(), covered.end(), 1)) * pixel * pixel;
}

}  // namespace

Silhouette widestSilhouette(const CoarseSamples& samples) {
  glm::dvec3 lower(std::numeric_limits<double>::max()), upper(-std::numeric_limits<double>::max());
  for (const glm::dvec3& position : samples.positions) {
    lower = glm::min(lower, position);
    upper = glm::max(upper, position);
  }
  if (samples.size() == 0) return {"iso", 0};
  Silhouette best{"iso", 0};
  for (const std::string_view view : kViews) {
    const Camera camera = Camera::named(view, lower, upper, {kPixels, kPixels}, Projection::kOrthographic);
    const double area = areaFrom(samples, camera.viewFromWorld());
    if (view == "iso" || area > best.area * (best.view == "iso" ? kPreferIso : kPreferEarlier))
      best = {view, area};
  }
  return best;
}

}  // namespace curvisplat
