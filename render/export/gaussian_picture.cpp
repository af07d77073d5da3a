#include "render/export/gaussian_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kLowPassPx2 = 0.3;
constexpr float kMinAlpha = 1.0f / 255, kMaxAlpha = 0.99f;  // as the published renderer has them

struct View {
  glm::dvec3 right, down, forward, position;
  double pixels;  // to a world unit
};

View viewOf(const Camera& camera, ImageSize size) {
  if (camera.projection != Projection::kOrthographic)
    throw UsageError("Gaussian splats are compared with orthographic cameras only");
  View view;
  view.forward = glm::normalize(camera.focal_point - camera.position);
  view.right = glm::normalize(glm::cross(view.forward, camera.usableViewUp()));
  view.down = glm::cross(view.forward, view.right);
  view.position = camera.focal_point;
  view.pixels = 0.5 * size.height / camera.parallel_scale;
  return view;
}

/// One splat on the screen: its ellipse is xx x² + 2 xy x y + yy y² = q.
struct Footprint {
  float x, y, xx, xy, yy, reach_x, reach_y;
};

Footprint footprintOf(const GaussianSplat& splat, const View& view, ImageSize size) {
  const glm::dmat3 axes = glm::mat3_cast(glm::dquat(splat.rotation));
  double cxx = kLowPassPx2, cxy = 0, cyy = kLowPassPx2;
  for (int axis = 0; axis < 3; ++axis) {
    const glm::dvec3 along = axes[axis] * (view.pixels * static_cast<double>(splat.deviation[axis]));
    const double u = glm::dot(along, view.right), v = glm::dot(along, view.down);
    cxx += u * u;
    cxy += u * v;
    cyy += v * v;
  }
  const double determinant = cxx * cyy - cxy * cxy;
  const glm::dvec3 from = glm::dvec3(splat.position) - view.position;
  // As far as the alpha of an opaque one is 1/255.
  const double reach = std::sqrt(2 * std::log(255.0));
  return {static_cast<float>(0.5 * size.width + view.pixels * glm::dot(from, view.right)),
          static_cast<float>(0.5 * size.height + view.pixels * glm::dot(from, view.down)),
          static_cast<float>(cyy / determinant),
          static_cast<float>(-cxy / determinant),
          static_cast<float>(cxx / determinant),
          static_cast<float>(reach * std::sqrt(cxx)),
          static_cast<float>(reach * std::sqrt(cyy))};
}

/// The whole pixels whose middles lie in [middle - reach, middle + reach], within 0 .. size - 1.
std::pair<int, int> pixelsIn(float middle, float reach, int size) {
  const float first = std::ceil(middle - reach - 0.5f), last = std::floor(middle + reach - 0.5f);
  return {static_cast<int>(std::clamp(first, 0.0f, static_cast<float>(size))),
          static_cast<int>(std::clamp(last, -1.0f, static_cast<float>(size - 1)))};
}

void blend(const GaussianSplat& splat, const Footprint& print, Image& image) {
  const auto [x0, x1] = pixelsIn(print.x, print.reach_x, image.size.width);
  const auto [y0, y1] = pixelsIn(print.y, print.reach_y, image.size.height);
  for (int y = y0; y <= y1; ++y) {
    const float dy = static_cast<float>(y) + 0.5f - print.y;
    for (int x = x0; x <= x1; ++x) {
      const float dx = static_cast<float>(x) + 0.5f - print.x;
      const float q = print.xx * dx * dx + 2 * print.xy * dx * dy + print.yy * dy * dy;
      const float alpha = std::min(kMaxAlpha, splat.opacity * std::exp(-0.5f * q));
      if (alpha < kMinAlpha) continue;
      float* pixel = image.pixel(x, y);  // front to back: [3] is what is absorbed so far
      const float share = (1 - pixel[3]) * alpha;
      for (int c = 0; c < 3; ++c) pixel[c] += share * splat.colour[c];
      pixel[3] += share;
    }
  }
}

}  // namespace

Image drawGaussians(std::span<const GaussianSplat> splats, const Camera& camera, ImageSize size) {
  const View view = viewOf(camera, size);
  std::vector<std::pair<float, uint32_t>> order(splats.size());
  for (uint32_t n = 0; n < splats.size(); ++n)
    order[n] = {static_cast<float>(glm::dot(glm::dvec3(splats[n].position) - view.position, view.forward)),
                n};
  std::sort(order.begin(), order.end());
  Image image(size);
  for (const auto& [depth, n] : order) blend(splats[n], footprintOf(splats[n], view, size), image);
  for (size_t at = 0; at < image.rgba.size(); at += 4) {
    for (size_t c = 0; c < 3; ++c) image.rgba[at + c] += 1 - image.rgba[at + 3];
    image.rgba[at + 3] = 1;
  }
  return image;
}

}  // namespace curvisplat
