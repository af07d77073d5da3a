#include "preprocess/splats/reshape.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "preprocess/splats/shape.h"
#include "stream/model/layers_code.h"

namespace curvisplat {
namespace {

constexpr double kAlong = 0.7;     // cosine of directions that are about the same
constexpr double kMin = 1.0 / 64;  // less growth becomes none

/// Changes A to A M, and shifts the splat, both in its frame. Returns the rotation from the old frame's directions to the new one's.
glm::dmat3 change(const glm::dmat3& m, const glm::dvec3& shift, Splat& splat, std::span<SplatScalar> values) {
  const glm::dmat3 a = splat.factor();
  const CellShape shape = shapeFromJacobian(a * m, 0);
  splat.position += a * shift;
  splat.axis = shape.axis;
  splat.shear = shape.shear;
  for (SplatScalar& value : values) {
    value.mean += glm::dot(value.slope, shift);
    value.slope = shape.rotation * (m * value.slope);
  }
  return shape.rotation;
}

LayeredBorder rotated(const LayeredBorder& border, const glm::dmat3& rotation) {
  if (border.code == kNoBorder) return border;
  const InwardAxes inward = inwardAxes(border.code);
  const auto axis = [&](int n) { return rotation * glm::dvec3(inward.axis[static_cast<size_t>(n)]); };
  if (inward.behind) return {packLayerCode(axis(0), static_cast<double>(inward.distance)), border.layers};
  std::array<glm::dvec3, 3> ends{};
  for (int n = 0; n < inward.count; ++n) ends[static_cast<size_t>(n)] = axis(n);
  const std::span<const glm::dvec3> of_ends(ends.data(), static_cast<size_t>(inward.count));
  if (border.layers == 0) return {packBorderCode(of_ends, inward.faces), 0};
  std::array<LayerAxis, 3> layers{};
  size_t count = 0;
  for (int n = inward.count; n < 3; ++n)
    if (const int of_lattice = latticeAxis(border.layers, n); of_lattice >= 0)
      layers[count++] = {axis(n), static_cast<uint8_t>(of_lattice), static_cast<double>(layerDistance(0))};
  return layeredBorder(of_ends, {layers.data(), count});
}

}  // namespace

void GrownAxes::add(const glm::dvec3& axis, double growth) {
  glm::dvec3 left = axis;
  for (size_t n = 0; n < count_; ++n) left -= glm::dot(left, axes_[n]) * axes_[n];
  const double length = glm::length(left);
  if (count_ == axes_.size() || std::abs(growth) < kMin || !(length > kAlong)) return;
  axes_[count_] = left / length;
  growth_[count_++] = growth;
}

bool Reshape::add(const glm::dvec3& axis, const AxisChange& change) {
  glm::dvec3 left = axis;
  for (size_t n = 0; n < count_; ++n) left -= glm::dot(left, axes_[n]) * axes_[n];
  const double length = glm::length(left);
  if (count_ == axes_.size() || !(length > kAlong)) return false;
  axes_[count_] = left / length;
  changes_[count_++] = change;
  return true;
}

void Reshape::apply(NodeSplat& node, std::span<SplatScalar> values) const {
  if (count_ == 0) return;
  glm::dmat3 m(1.0);
  glm::dvec3 shift(0.0);
  for (size_t n = 0; n < count_; ++n) {
    m += (changes_[n].factor - 1) * glm::outerProduct(axes_[n], axes_[n]);
    shift += changes_[n].shift * axes_[n];
  }
  const glm::dmat3 rotation = change(m, shift, node.splat, values);

  GrownAxes grown;
  for (size_t n = 0; n < count_; ++n) grown.add(rotation * axes_[n], changes_[n].growth);
  const CellGrowth before = cellGrowth(node.growth_code);
  for (size_t n = 0; n < 3; ++n) {
    const glm::dvec3 axis(before.axis[n]);
    const bool is_changed =
        std::any_of(axes_.begin(), axes_.begin() + static_cast<ptrdiff_t>(count_),
                    [&](const glm::dvec3& changed) { return std::abs(glm::dot(changed, axis)) > kAlong; });
    if (before.growth[n] != 0 && !is_changed)
      grown.add(rotation * axis, static_cast<double>(before.growth[n]));
  }
  node.growth_code = grown.code();
  const LayeredBorder border = rotated({node.border_code, node.layers}, rotation);
  node.border_code = border.code;
  node.layers = border.layers;
  for (JointLine& line : node.lines)
    if (line.isThere()) line.setInward(rotation * line.inward());
}

}  // namespace curvisplat
