#include "render/camera/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

// Splats reach a little beyond the box of the samples, and data that touches the image's edge looks clipped.
constexpr double kMargin = 1.05;

struct NamedView {
  std::string_view name;
  glm::dvec3 from, up;
};
constexpr std::array<NamedView, 7> kNamedViews{{{"iso", {1, 1, 1}, {0, 0, 1}},
                                                {"+x", {1, 0, 0}, {0, 0, 1}},
                                                {"-x", {-1, 0, 0}, {0, 0, 1}},
                                                {"+y", {0, 1, 0}, {0, 0, 1}},
                                                {"-y", {0, -1, 0}, {0, 0, 1}},
                                                {"+z", {0, 0, 1}, {0, 1, 0}},
                                                {"-z", {0, 0, -1}, {0, 1, 0}}}};

std::array<glm::dvec3, 8> cornersInView(const Camera& camera, const glm::dvec3& lower,
                                        const glm::dvec3& upper) {
  const glm::dmat4 view_from_world = camera.viewFromWorld();
  std::array<glm::dvec3, 8> corners;
  for (int n = 0; n < 8; ++n) {
    const glm::dvec3 world(n & 1 ? upper.x : lower.x, n & 2 ? upper.y : lower.y, n & 4 ? upper.z : lower.z);
    corners[n] = glm::dvec3(view_from_world * glm::dvec4(world, 1));
  }
  return corners;
}

/// Half the height that the image needs to show `corner`, whether its height or its width decides.
double halfHeight(const glm::dvec3& corner, ImageSize size) {
  return std::max(std::abs(corner.y), std::abs(corner.x) * size.height / size.width);
}

/// A direction that is not parallel to the unit vector `forward`: `up`, or VTK's replacement for it.
glm::dvec3 usableUp(const glm::dvec3& up, const glm::dvec3& forward) {
  const glm::dvec3 candidates[] = {up, {-up.z, up.x, up.y}, {0, 0, 1}, {0, 1, 0}};
  for (const glm::dvec3& candidate : candidates) {
    const double length = glm::length(candidate);
    if (length > 0 && std::abs(glm::dot(candidate, forward)) <= 0.999 * length) return candidate;
  }
  return {0, 1, 0};  // not reached: y and z cannot both be parallel to the view
}

glm::dvec3 directionOf(const Camera& camera) {
  const glm::dvec3 towards = camera.focal_point - camera.position;
  const double distance = glm::length(towards);
  if (!(distance > 0))
    throw UsageError("the camera's position and its focal point are one place, {},{},{}; move one of them",
                     camera.position.x, camera.position.y, camera.position.z);
  return towards / distance;
}

/// The view that other programs, or people, call so: " (did you mean +z?)".
std::string meantBy(std::string_view view) {
  constexpr std::pair<std::string_view, const char*> kOthers[] = {
      {"top", "+z"},   {"bottom", "-z"}, {"front", "-y"}, {"back", "+y"}, {"left", "-x"},
      {"right", "+x"}, {"x", "+x"},      {"y", "+y"},     {"z", "+z"},    {"3d", "iso"}};
  for (const auto& [other, ours] : kOthers)
    if (other == view) return fmt::format(" (did you mean {}?)", ours);
  std::vector<std::string> names;
  for (const NamedView& named : kNamedViews) names.emplace_back(named.name);
  return didYouMean(view, names);
}

/// Camera::fit(), for a camera that is to look from this direction, a unit vector.
void fitFrom(Camera& camera, const glm::dvec3& from, const glm::dvec3& lower, const glm::dvec3& upper,
             ImageSize size) {
  double diagonal = glm::length(upper - lower);
  if (!(diagonal > 0)) diagonal = 1;
  camera.position = camera.focal_point + diagonal * from;
  camera.parallel_scale = camera.parallelScaleFor(lower, upper, size);
  if (camera.projection == Projection::kOrthographic) return;
  // The smallest distance at which every corner is in the image. In view space corners lie at depths around
  // -diagonal.
  const double slope = std::tan(camera.view_angle_deg * std::numbers::pi / 360);
  double distance = 0;
  for (const glm::dvec3& corner : cornersInView(camera, lower, upper)) {
    const double nearer = corner.z + diagonal;
    distance = std::max(
        {distance, nearer + kMargin * halfHeight(corner, size) / slope, nearer + (kMargin - 1) * diagonal});
  }
  camera.position = camera.focal_point + distance * from;
}

}  // namespace

Camera Camera::named(std::string_view view, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size,
                     Projection projection, double view_angle_deg) {
  const auto found = std::find_if(kNamedViews.begin(), kNamedViews.end(),
                                  [&](const NamedView& named) { return named.name == view; });
  if (found == kNamedViews.end())
    throw UsageError("unknown view '{}'{}; expected iso, +x, -x, +y, -y, +z or -z", view, meantBy(view));

  Camera camera;
  camera.focal_point = 0.5 * (lower + upper);
  camera.view_up = found->up;
  camera.projection = projection;
  camera.view_angle_deg = view_angle_deg;
  fitFrom(camera, glm::normalize(found->from), lower, upper, size);
  return camera;
}

void Camera::fit(const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) {
  fitFrom(*this, -directionOf(*this), lower, upper, size);
}

double Camera::parallelScaleFor(const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) const {
  double scale = 0;
  for (const glm::dvec3& corner : cornersInView(*this, lower, upper))
    scale = std::max(scale, halfHeight(corner, size));
  return scale > 0 ? kMargin * scale : 1;
}

glm::dvec3 Camera::usableViewUp() const {
  return usableUp(view_up, directionOf(*this));
}

ViewAxes Camera::axes() const {
  const glm::dvec3 forward = directionOf(*this);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, usableUp(view_up, forward)));
  return {right, glm::cross(right, forward), forward};
}

glm::dmat4 Camera::viewFromWorld() const {
  const auto [right, up, forward] = axes();
  glm::dmat4 view_from_world(1);
  for (int axis = 0; axis < 3; ++axis)
    view_from_world[axis] = glm::dvec4(right[axis], up[axis], -forward[axis], 0);
  view_from_world[3] =
      glm::dvec4(-glm::dot(right, position), -glm::dot(up, position), glm::dot(forward, position), 1);
  return view_from_world;
}

}  // namespace curvisplat
