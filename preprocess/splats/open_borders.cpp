#include "preprocess/splats/open_borders.h"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>

#include "preprocess/splats/shape.h"

namespace curvisplat {
namespace {

constexpr double kSimilar = 0.5;    // cosine: of one direction
constexpr double kOpposite = -0.5;  // of two that close one another
constexpr double kMin = 0.1;        // what must be left of a direction at right angles to the others

}  // namespace

bool isOpen(const Splat& face, uint32_t border_code, const Splat& behind) {
  const InwardAxes inward = inwardAxes(border_code);
  const glm::dvec3 direction = glm::normalize(inFrameOf(face, behind.position - face.position));
  for (int a = 0; a < inward.count; ++a)
    if (inward.hasFace(a) && glm::dot(glm::dvec3(inward.axis[static_cast<size_t>(a)]), direction) > kSimilar)
      return true;
  return false;
}

void OpenBorders::add(const Splat& part, uint32_t border_code) {
  const InwardAxes inward = inwardAxes(border_code);
  for (int a = 0; a < inward.count; ++a)
    inward_.push_back(
        {part.factor() * glm::dvec3(inward.axis[static_cast<size_t>(a)]), parts_, inward.hasFace(a)});
  ++parts_;
}

LayeredBorder OpenBorders::of(const Splat& merged, std::span<const Layer> layers) const {
  std::vector<glm::dvec3> directions;
  for (const Inward& inward : inward_) directions.push_back(glm::normalize(inFrameOf(merged, inward.along)));

  struct Open {
    glm::dvec3 along;  // sum of similar directions
    bool face;
  };
  std::vector<Open> open;
  for (size_t n = 0; n < directions.size(); ++n) {
    const glm::dvec3& direction = directions[n];
    bool closed = false;
    for (size_t m = 0; m < directions.size(); ++m)
      closed |= inward_[m].part != inward_[n].part && glm::dot(directions[m], direction) < kOpposite;
    if (closed) continue;
    const auto same = std::find_if(open.begin(), open.end(), [&](const Open& other) {
      return glm::dot(glm::normalize(other.along), direction) > kSimilar;
    });
    if (same == open.end()) {
      open.push_back({direction, inward_[n].face});
    } else {
      same->along += direction;
      same->face &= inward_[n].face;
    }
  }

  std::array<glm::dvec3, 3> axes;
  size_t count = 0;
  uint32_t faces = 0;
  for (const Open& border : open) {
    glm::dvec3 axis = glm::normalize(border.along);
    for (size_t n = 0; n < count; ++n) axis -= glm::dot(axis, axes[n]) * axes[n];
    if (count == 3 || glm::length(axis) <= kMin) continue;
    if (border.face) faces |= 1u << count;
    axes[count++] = glm::normalize(axis);
  }
  if (faces != (1u << count) - 1) return {packBorderCode({axes.data(), count}, faces), 0};
  std::array<LayerAxis, 3> behind{};
  size_t behind_count = 0;
  for (const Layer& layer : layers) {
    glm::dvec3 axis = glm::normalize(inFrameOf(merged, layer.inward));
    if (std::any_of(directions.begin(), directions.end(), [&](const glm::dvec3& direction) {
          return std::abs(glm::dot(direction, axis)) > kSimilar;
        }))
      continue;
    for (size_t n = 0; n < count; ++n) axis -= glm::dot(axis, axes[n]) * axes[n];
    for (size_t n = 0; n < behind_count; ++n) axis -= glm::dot(axis, behind[n].inward) * behind[n].inward;
    if (count + behind_count == 3 || !(glm::length(axis) > kSimilar)) continue;
    axis = glm::normalize(axis);
    behind[behind_count++] = {axis, layer.axis,
                              glm::dot(axis, inFrameOf(merged, merged.position - layer.face))};
  }
  return layeredBorder({axes.data(), count}, {behind.data(), behind_count});
}

}  // namespace curvisplat
