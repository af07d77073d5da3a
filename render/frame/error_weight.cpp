#include "render/frame/error_weight.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

namespace curvisplat {
namespace {

constexpr double kMaxHiddenPixels = 4;
constexpr double kMinWeight = 0.25;
// What counts as shown, as the opacity of the optical depth (bench/README.md, "Rendering from growing caches").
constexpr double kShownChange = 0.05;
constexpr double kShownRipple = 1;
constexpr double kMaxShare = 1.0 / 48;

/// The least |d_i| of the directions d from the eye to the points of a box, along any axis.
double leastComponent(const Brick& brick, const CutView& view) {
  double least = 1;
  if (!view.perspective) {
    const glm::dvec3 d = glm::abs(glm::normalize(view.towards_viewer));
    return std::min({d.x, d.y, d.z});
  }
  const glm::dvec3 lower = view.scale * brick.lower, upper = view.scale * brick.upper;
  const double farthest = glm::length(glm::max(glm::abs(lower - view.eye), glm::abs(upper - view.eye)));
  for (int axis = 0; axis < 3; ++axis) {
    const double apart = std::max({lower[axis] - view.eye[axis], view.eye[axis] - upper[axis], 0.0});
    least = std::min(least, farthest > 0 ? apart / farthest : 0);
  }
  return least;
}

}  // namespace

double leastErrorWeight(double lod_pixels) {
  return lod_pixels > 0 ? std::clamp(lod_pixels / kMaxHiddenPixels, kMinWeight, 1.0) : 1.0;
}

double errorWeight(const VoxelLoss& loss, double least) {
  if (loss.share > kMaxShare) return 1;
  const double shown =
      std::max(-std::expm1(-loss.changed) / kShownChange, -std::expm1(-loss.rippling) / kShownRipple);
  return std::clamp(shown, least, 1.0);
}

double lengthInStep(const Brick& brick, const CutView& view, double voxel, double whole) {
  const double component = leastComponent(brick, view);
  return component * whole * std::numbers::pi > voxel ? voxel / (component * std::numbers::pi) : whole;
}

}  // namespace curvisplat
