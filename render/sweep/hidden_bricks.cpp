#include "render/sweep/hidden_bricks.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/project/footprint.h"
#include "render/project/plane_cuts.h"

namespace curvisplat {
namespace {

constexpr float kEverywhere = std::numeric_limits<float>::infinity();
constexpr double kRoundingPixels = 1;

/// How far along the ray a splat of the brick reaches from its centre, at most.
double reachAlongRay(const Brick& brick, const ScreenView& view) {
  // Along the ray a splat's distribution reaches a little beyond its support (plane_cuts.h).
  constexpr double kBeyond = double{kDepthReach} / kKernelSupport;
  return kBeyond * brick.largest_radius * std::max({view.scale.x, view.scale.y, view.scale.z});
}

}  // namespace

ScreenBox screenBoxOf(const Brick& brick, const ScreenView& view) {
  const bool perspective = view.projection == Projection::kPerspective;
  const double radius = brick.largest_radius * std::max({view.scale.x, view.scale.y, view.scale.z});
  glm::dvec2 lower(INFINITY), upper(-INFINITY);
  double nearest = INFINITY, widest = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 at = view.viewFromData({corner & 1 ? brick.upper.x : brick.lower.x,
                                             corner & 2 ? brick.upper.y : brick.lower.y,
                                             corner & 4 ? brick.upper.z : brick.lower.z});
    if (perspective) {
      // Splats close to the eye are cut into pieces. Each piece is drawn with its own linear map, at a
      // centre that is up to a radius nearer.
      if (at.z < std::max(view.near, 2 * radius))
        return {-kEverywhere, -kEverywhere, kEverywhere, kEverywhere};
      nearest = std::min(nearest, at.z - radius);
      widest = std::max(widest, (std::max(std::abs(at.x), std::abs(at.y)) + radius) / (at.z - radius));
    }
    const glm::dvec2 pixel = view.pixelFromView(at);
    lower = glm::min(lower, pixel);
    upper = glm::max(upper, pixel);
  }
  // A row of the map at (x, y, z) has the length focal_px / z √(1 + (x / z)²).
  const double pixels_a_unit =
      perspective ? view.focal_px / nearest * std::hypot(1.0, widest) : view.focal_px;
  const double reach =
      radius * pixels_a_unit + kKernelSupport * std::sqrt(view.low_pass_px2) + kRoundingPixels;
  return {static_cast<float>(lower.x - reach), static_cast<float>(lower.y - reach),
          static_cast<float>(upper.x + reach), static_cast<float>(upper.y + reach)};
}

double nearestDepthOf(const Brick& brick, const ScreenView& view) {
  const glm::dvec3 lower = view.scale * brick.lower, upper = view.scale * brick.upper;
  const double nearest = view.projection == Projection::kPerspective
                             ? glm::length(glm::clamp(view.eye, lower, upper) - view.eye)
                             : glm::dot(view.forward, 0.5 * (lower + upper) - view.eye) -
                                   glm::dot(glm::abs(view.forward), 0.5 * (upper - lower));
  return nearest - reachAlongRay(brick, view);
}

double farthestDepthOf(const Brick& brick, const ScreenView& view) {
  const glm::dvec3 lower = view.scale * brick.lower, upper = view.scale * brick.upper;
  const double farthest = view.projection == Projection::kPerspective
                              ? glm::length(glm::max(glm::abs(lower - view.eye), glm::abs(upper - view.eye)))
                              : glm::dot(view.forward, 0.5 * (lower + upper) - view.eye) +
                                    glm::dot(glm::abs(view.forward), 0.5 * (upper - lower));
  return farthest + reachAlongRay(brick, view);
}

void HiddenBricks::begin(std::span<const Brick> bricks, const ScreenView& view) {
  bricks_ = bricks;
  view_ = view;
  painter_ = nullptr;
}

bool HiddenBricks::hides(uint32_t brick) const {
  const Painter* painter = painter_;
  return painter && painter->hides(screenBoxOf(bricks_[brick], view_));
}

}  // namespace curvisplat
