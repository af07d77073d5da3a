#include "render/project/screen_view.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "render/project/footprint.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kMinLowPass = 0.01;

}  // namespace

ScreenView ScreenView::of(const Camera& camera, ImageSize size, const glm::dvec3& scale, double low_pass_px2,
                          double near) {
  if (size.width < 1 || size.height < 1)
    throw UsageError("an image of {}x{} pixels has nothing to show; ask for at least 1x1", size.width,
                     size.height);
  for (int axis = 0; axis < 3; ++axis)
    if (!(scale[axis] > 0 && std::isfinite(scale[axis])))
      throw UsageError("the scale along {} is {}; it must be positive", "xyz"[axis], scale[axis]);

  // At 0 a splat seen edge-on would be infinitely opaque.
  if (!(low_pass_px2 >= kMinLowPass))
    throw UsageError("a low-pass of {} px² is too little to draw with; use at least {}", low_pass_px2,
                     kMinLowPass);

  ScreenView view;
  view.projection = camera.projection;
  view.size = size;
  view.scale = scale;
  view.low_pass_px2 = low_pass_px2;
  view.near = near;
  const glm::dmat4 view_from_world = camera.viewFromWorld();
  const auto row = [&](int r) {
    return glm::dvec3(view_from_world[0][r], view_from_world[1][r], view_from_world[2][r]);
  };
  view.eye = camera.position;
  view.right = row(0);
  view.down = -row(1);
  view.forward = -row(2);

  if (camera.projection == Projection::kOrthographic) {
    if (!(camera.parallel_scale > 0 && std::isfinite(camera.parallel_scale)))
      throw UsageError("the camera's parallel scale is {}; it must be positive", camera.parallel_scale);
    view.focal_px = 0.5 * size.height / camera.parallel_scale;
  } else {
    if (!(camera.view_angle_deg > 0 && camera.view_angle_deg < 180))
      throw UsageError("the camera's view angle is {} degrees; it must be between 0 and 180",
                       camera.view_angle_deg);
    view.focal_px = 0.5 * size.height / std::tan(0.5 * glm::radians(camera.view_angle_deg));
  }
  return view;
}

glm::dvec3 ScreenView::viewFromData(const glm::dvec3& data) const {
  const glm::dvec3 from_eye = scale * data - eye;
  return {glm::dot(right, from_eye), glm::dot(down, from_eye), glm::dot(forward, from_eye)};
}

CutView ScreenView::cutView() const {
  CutView cut;
  cut.perspective = projection == Projection::kPerspective;
  cut.scale = scale;
  cut.eye = eye;
  cut.towards_viewer = -forward;
  cut.pixels = focal_px;
  const double reach = kKernelSupport * std::sqrt(low_pass_px2);
  const double edge_x = (0.5 * size.width + reach) / focal_px,
               edge_y = (0.5 * size.height + reach) / focal_px;
  for (const glm::dvec3& side : {edge_x * right, -edge_x * right, edge_y * down, -edge_y * down}) {
    // The edge lies at `side` from the eye's axis; in perspective, at distance 1 along it.
    const double edge = glm::length(side);
    const glm::dvec3 outwards = side / edge;
    if (cut.perspective) {
      const glm::dvec3 normal = glm::normalize(edge * forward - outwards);
      cut.planes.push_back({normal, -glm::dot(normal, eye)});
    } else {
      cut.planes.push_back({-outwards, glm::dot(outwards, eye) + edge});
    }
  }
  if (cut.perspective) cut.planes.push_back({forward, -glm::dot(forward, eye) - near});
  return cut;
}

glm::dvec2 ScreenView::pixelFromView(const glm::dvec3& view) const {
  const double pixels = projection == Projection::kOrthographic ? focal_px : focal_px / view.z;
  return {0.5 * size.width + pixels * view.x, 0.5 * size.height + pixels * view.y};
}

}  // namespace curvisplat
