#include "render/frame/pixel_values.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace curvisplat {

glm::dvec3 placeOf(const ScreenView& view, int x, int y, double depth) {
  const double across = (x + 0.5 - 0.5 * view.size.width) / view.focal_px;
  const double down = (y + 0.5 - 0.5 * view.size.height) / view.focal_px;
  if (view.projection == Projection::kPerspective) return depth * glm::normalize(glm::dvec3(across, down, 1));
  return {across, down, depth};
}

namespace {

/// Of a layer's pixel, from the neighbours that are nearest in depth; 0 without neighbours.
glm::dvec3 layerNormal(const ScreenView& view, const std::vector<float>& depths, int x, int y) {
  const auto depthAt = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= view.size.width || row >= view.size.height)
      return std::numeric_limits<double>::infinity();
    return double{depths[static_cast<size_t>(row) * static_cast<size_t>(view.size.width) +
                         static_cast<size_t>(column)]};
  };
  const double here = depthAt(x, y);
  const glm::dvec3 at = placeOf(view, x, y, here);
  const auto along = [&](int dx, int dy) {
    const double before = depthAt(x - dx, y - dy), after = depthAt(x + dx, y + dy);
    const int sign = std::abs(after - here) <= std::abs(before - here) ? 1 : -1;
    const double there = sign > 0 ? after : before;
    if (!std::isfinite(there)) return glm::dvec3(0.0);
    return double(sign) * (placeOf(view, x + sign * dx, y + sign * dy, there) - at);
  };
  const glm::dvec3 n = glm::cross(along(1, 0), along(0, 1));
  const double length = glm::length(n);
  return length > 0 ? n / length : glm::dvec3(0.0);
}

}  // namespace

PixelValues pixelValuesOf(const Image& painted, const ScreenView& view, double depth_origin) {
  const size_t pixels = painted.size.pixels();
  PixelValues values{painted.size, std::vector<float>(pixels), std::vector<float>(pixels),
                     std::vector<glm::vec3>(pixels, glm::vec3(0.0f))};
  for (size_t n = 0; n < pixels; ++n) {
    values.depth[n] = static_cast<float>(double{painted.rgba[4 * n]} + depth_origin);
    values.scalar[n] = painted.rgba[4 * n + 1];
  }
  for (int y = 0; y < painted.size.height; ++y)
    for (int x = 0; x < painted.size.width; ++x) {
      const size_t n =
          static_cast<size_t>(y) * static_cast<size_t>(painted.size.width) + static_cast<size_t>(x);
      if (!std::isfinite(values.depth[n])) continue;
      const double nx = painted.rgba[4 * n + 2], ny = painted.rgba[4 * n + 3];
      glm::dvec3 normal(nx, ny, -std::sqrt(std::max(0.0, 1 - nx * nx - ny * ny)));
      if (nx == kOfLayer)
        normal = layerNormal(view, values.depth, x, y);
      else if (std::isnan(nx))
        normal = glm::dvec3(0.0);
      if (glm::dot(normal, placeOf(view, x, y, 1)) > 0 && nx == kOfLayer) normal = -normal;
      values.normal[n] = glm::vec3(normal.x * view.right + normal.y * view.down + normal.z * view.forward);
    }
  return values;
}

}  // namespace curvisplat
