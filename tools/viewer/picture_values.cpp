#include "tools/viewer/picture_values.h"

#include <algorithm>
#include <cmath>

#include "render/frame/frame_plan.h"

namespace curvisplat {

std::optional<glm::dvec3> pointSeenAt(const ShownValues& shown, const Manifest& manifest,
                                      const glm::dvec2& pixel, ImageSize size) {
  const ImageSize own = shown.values.size;
  if (own.width <= 0 || size.width <= 0 || size.height <= 0) return std::nullopt;
  const glm::dvec2 at(pixel.x * own.width / size.width, pixel.y * own.height / size.height);
  const int column = static_cast<int>(std::floor(at.x)), row = static_cast<int>(std::floor(at.y));
  if (column < 0 || row < 0 || column >= own.width || row >= own.height) return std::nullopt;
  const auto index = static_cast<size_t>(row) * static_cast<size_t>(own.width) + static_cast<size_t>(column);
  const auto depth = static_cast<double>(shown.values.depth[index]);
  if (!std::isfinite(depth)) return std::nullopt;
  const ScreenView view = screenViewOf(manifest, shown.camera, shown.options, own);
  const glm::dvec3 place = placeOf(view, column, row, depth);
  const glm::dvec3 stretched = view.eye + place.x * view.right + place.y * view.down + place.z * view.forward;
  return stretched / view.scale;
}

}  // namespace curvisplat
