#include "tests/reference/splat_compositor.h"

#include <cmath>
#include <vector>

#include "render/project/kernel.h"

namespace curvisplat {
namespace {

/// What one splat adds at an offset from its centre, premultiplied.
glm::dvec4 contribution(const ScreenSplat& splat, double dx, double dy, const ClassificationTable& table,
                        bool per_pixel) {
  const double u0 = dx / splat.l11;
  const double u1 = (dy - splat.l21 * u0) / splat.l22;
  const double depth = splat.amplitude * footprint(std::hypot(u0, u1));
  if (depth == 0) return glm::dvec4(0.0);
  const glm::dvec4 mean =
      per_pixel
          ? table.mean(splat.mean + double{splat.slope0} * u0 + double{splat.slope1} * u1, splat.half_width)
          : table.mean(splat.mean, 0);
  if (mean.w == 0) return glm::dvec4(0.0);
  const double alpha = -std::expm1(-mean.w * depth);
  return glm::dvec4(glm::dvec3(mean) / mean.w, 1.0) * alpha;
}

}  // namespace

Image compositeSplats(std::span<const ScreenSplat> splats, const ClassificationTable& table, bool per_pixel,
                      ImageSize size, const glm::vec4& background) {
  std::vector<glm::dvec4> pixels(size.pixels(), glm::dvec4(background));
  for (const ScreenSplat& splat : splats)
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x) {
        const glm::dvec4 above = contribution(splat, x + 0.5 - splat.x, y + 0.5 - splat.y, table, per_pixel);
        glm::dvec4& pixel =
            pixels[static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x)];
        pixel = above + (1 - above.w) * pixel;
      }
  Image image(size);
  for (size_t n = 0; n < pixels.size(); ++n)
    for (int channel = 0; channel < 4; ++channel)
      image.rgba[4 * n + static_cast<size_t>(channel)] = static_cast<float>(pixels[n][channel]);
  return image;
}

}  // namespace curvisplat
