#include "preprocess/splats/face_layers.h"

#include <glm/geometric.hpp>
#include <utility>

#include "stream/base/check.h"
#include "stream/model/border_code.h"
#include "stream/model/layers_code.h"

namespace curvisplat {

LayeredBorder layeredBorder(std::span<const glm::dvec3> ends, std::span<const LayerAxis> layers) {
  CURVISPLAT_CHECK_OP(ends.size() + layers.size(), <=, size_t{3});
  if (layers.empty()) return {packBorderCode(ends, (1u << ends.size()) - 1), 0};
  std::array<glm::dvec3, 3> axes{};
  std::array<uint8_t, 3> of_lattice{};  // 1 and the axis
  size_t count = 0;
  for (const glm::dvec3& end : ends) axes[count++] = end;
  for (const LayerAxis& layer : layers) {
    of_lattice[count] = static_cast<uint8_t>(layer.axis + 1);
    axes[count++] = layer.inward;
  }
  if (layers.size() == 3 && glm::dot(glm::cross(axes[0], axes[1]), axes[2]) < 0) {
    std::swap(axes[0], axes[1]);
    std::swap(of_lattice[0], of_lattice[1]);
  }
  LayeredBorder border;
  border.code = count == 1 ? packLayerCode(axes[0], layers[0].distance)
                           : packLayersCode({axes.data(), count}, ends.size());
  if (border.code == kNoBorder) return border;
  for (size_t n = 0; n < count; ++n) border.layers |= static_cast<uint8_t>(of_lattice[n] << 2 * n);
  return border;
}

LayeredBorder withoutSeams(const LayeredBorder& border, uint32_t axes) {
  const InwardAxes inward = inwardAxes(border.code);
  std::array<glm::dvec3, 3> ends{};
  std::array<LayerAxis, 3> layers{};
  size_t end_count = 0, layer_count = 0;
  bool any_seam = false;
  for (int n = 0; n < 3; ++n) {
    const glm::dvec3 axis(inward.axis[static_cast<size_t>(n)]);
    const int of_lattice = latticeAxis(border.layers, n);
    if (of_lattice < 0) {
      if (n < inward.count) ends[end_count++] = axis;
    } else if ((axes >> of_lattice & 1) != 0) {
      any_seam = true;
    } else {
      layers[layer_count++] = {axis, static_cast<uint8_t>(of_lattice), layerDistance(0)};
    }
  }
  if (!any_seam) return border;
  return layeredBorder({ends.data(), end_count}, {layers.data(), layer_count});
}

}  // namespace curvisplat
