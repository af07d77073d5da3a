#include "tests/reference/splat_compositor.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "render/project/kernel.h"
#include "render/project/light.h"

namespace curvisplat {
namespace {

/// The integral of x^power b(x) up to x, b the biweight of ScreenCut: its antiderivative, from the middle on.
double biweight(int power, double x) {
  const double y = x / std::sqrt(7.0), y2 = y * y;
  switch (power) {
    case 0:
      return 15.0 / 16 * y * (1 - 2 * y2 / 3 + y2 * y2 / 5);
    case 1:
      return -5 * std::sqrt(7.0) / 32 * std::pow(1 - y2, 3);
    default:
      return 7 * 15.0 / 16 * y * y2 * (1.0 / 3 - 2 * y2 / 5 + y2 * y2 / 7);
  }
}

/// What is left along the ray at u; `mean` and `variance` of its depths.
struct Remainder {
  double share = 1, mean = 0, variance = 1;
};
Remainder remainderOf(const ScreenCut& cut, double u0, double u1) {
  double lo = -std::sqrt(7.0), hi = std::sqrt(7.0);
  for (size_t n = 0; n < ScreenCut::kFaces; ++n) {
    const double a = cut.faces[n][0] + cut.faces[n][1] * u0 + cut.faces[n][2] * u1;
    if (cut.far_sides >> n & 1)
      lo = std::max(lo, -a);
    else
      hi = std::min(hi, a);
  }
  Remainder left;
  if (!(lo < hi)) return {0, 0, 0};
  left.share = biweight(0, hi) - biweight(0, lo);
  left.mean = (biweight(1, hi) - biweight(1, lo)) / left.share;
  left.variance = (biweight(2, hi) - biweight(2, lo)) / left.share - left.mean * left.mean;
  return left;
}

/// What one splat adds at an offset from its centre, premultiplied. `cut`: null where it has none.
glm::dvec4 contribution(const ScreenSplat& splat, const ScreenCut* cut, double dx, double dy,
                        const ClassificationTable& table, PixelShading shading) {
  const double u0 = dx / splat.l11;
  const double u1 = (dy - splat.l21 * u0) / splat.l22;
  const Remainder left = cut ? remainderOf(*cut, u0, u1) : Remainder{};
  const double depth = std::abs(splat.amplitude) * footprint(std::hypot(u0, u1)) * left.share;
  if (depth == 0) return glm::dvec4(0.0);
  const double widest = shading.lit ? unpackHalfWidth(splat.half_width) : splat.half_width;
  const Lit lit = shading.lit ? unpackLit(splat.half_width) : Lit{};
  double f = splat.mean, half_width = 0;
  if (shading.per_pixel) {
    const double deviation = cut ? cut->correlation * widest / std::sqrt(3.0) : 0;
    f += double{splat.slope0} * u0 + double{splat.slope1} * u1 + deviation * left.mean;
    half_width = std::sqrt(std::max(0.0, widest * widest - 3 * deviation * deviation * (1 - left.variance)));
  }
  const glm::dvec4 mean = table.mean(f, half_width);
  if (mean.w == 0) return glm::dvec4(0.0);
  const double alpha = -std::expm1(-mean.w * depth);
  const glm::dvec3 colour = double{lit.diffuse} * glm::dvec3(mean) / mean.w + double{lit.specular};
  return glm::dvec4(colour, 1.0) * alpha;
}

}  // namespace

Image compositeSplats(std::span<const ScreenSplat> splats, const ClassificationTable& table,
                      PixelShading shading, ImageSize size, const glm::vec4& background) {
  std::vector<glm::dvec4> pixels(size.pixels(), glm::dvec4(background));
  for (size_t n = 0; n < splats.size(); ++n) {
    const ScreenSplat& splat = splats[n];
    if (isCut(splat)) continue;
    std::optional<ScreenCut> cut;
    if (hasCut(splat)) cut = ScreenCut::of(splats[n + 1]);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x) {
        const glm::dvec4 above =
            contribution(splat, cut ? &*cut : nullptr, x + 0.5 - splat.x, y + 0.5 - splat.y, table, shading);
        glm::dvec4& pixel =
            pixels[static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x)];
        pixel = above + (1 - above.w) * pixel;
      }
  }
  Image image(size);
  for (size_t n = 0; n < pixels.size(); ++n)
    for (int channel = 0; channel < 4; ++channel)
      image.rgba[4 * n + static_cast<size_t>(channel)] = static_cast<float>(pixels[n][channel]);
  return image;
}

}  // namespace curvisplat
