#include "tools/viewer/camera_controls.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

namespace curvisplat {
namespace {

constexpr double kDegreesAcross = 200;  // VTK's trackball camera

struct ViewAxes {
  glm::dvec3 right, up, forward;
};

ViewAxes axesOf(const Camera& camera) {
  const glm::dvec3 forward = glm::normalize(camera.focal_point - camera.position);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, camera.usableViewUp()));
  return {right, glm::cross(right, forward), forward};
}

glm::dvec3 turned(const glm::dvec3& vector, double degrees, const glm::dvec3& axis) {
  return glm::dvec3(glm::rotate(glm::dmat4(1), glm::radians(degrees), axis) * glm::dvec4(vector, 0));
}

double distanceOf(const Camera& camera) {
  return glm::length(camera.focal_point - camera.position);
}

double halfAngleTangent(const Camera& camera) {
  return std::tan(glm::radians(camera.view_angle_deg) / 2);
}

}  // namespace

double unitsPerPixel(const Camera& camera, ImageSize size) {
  const double half_height = camera.projection == Projection::kOrthographic
                                 ? camera.parallel_scale
                                 : distanceOf(camera) * halfAngleTangent(camera);
  return 2 * half_height / size.height;
}

Camera rotated(const Camera& camera, const glm::dvec2& movement, ImageSize size) {
  const ViewAxes axes = axesOf(camera);
  const double about_up = -kDegreesAcross * movement.x / size.width;
  const double about_right = -kDegreesAcross * movement.y / size.height;
  const glm::dvec3 right = turned(axes.right, about_up, axes.up);
  Camera result = camera;
  const glm::dvec3 away = turned(camera.position - camera.focal_point, about_up, axes.up);
  result.position = camera.focal_point + turned(away, about_right, right);
  result.view_up = turned(axes.up, about_right, right);
  return result;
}

Camera panned(const Camera& camera, const glm::dvec2& movement, ImageSize size) {
  const ViewAxes axes = axesOf(camera);
  const double unit = unitsPerPixel(camera, size);
  const glm::dvec3 shift = unit * (movement.y * axes.up - movement.x * axes.right);
  Camera result = camera;
  result.position += shift;
  result.focal_point += shift;
  return result;
}

Camera zoomed(const Camera& camera, double factor) {
  Camera result = camera;
  if (camera.projection == Projection::kOrthographic)
    result.parallel_scale /= factor;
  else
    result.position = camera.focal_point + (camera.position - camera.focal_point) / factor;
  return result;
}

Camera zoomedAt(const Camera& camera, double factor, const glm::dvec2& pixel, ImageSize size) {
  const glm::dvec2 from_middle = pixel - 0.5 * glm::dvec2(size.width, size.height);
  return panned(zoomed(camera, factor), (1 - factor) * from_middle, size);
}

Camera looking(const Camera& camera, const glm::dvec2& movement, ImageSize size) {
  const ViewAxes axes = axesOf(camera);
  const double degrees_per_pixel = camera.view_angle_deg / size.height;
  const double about_up = -degrees_per_pixel * movement.x, about_right = -degrees_per_pixel * movement.y;
  const glm::dvec3 right = turned(axes.right, about_up, axes.up);
  Camera result = camera;
  const glm::dvec3 ahead = turned(camera.focal_point - camera.position, about_up, axes.up);
  result.focal_point = camera.position + turned(ahead, about_right, right);
  result.view_up = turned(axes.up, about_right, right);
  return result;
}

Camera flown(const Camera& camera, const glm::dvec3& step) {
  const ViewAxes axes = axesOf(camera);
  const glm::dvec3 shift = step.x * axes.right + step.y * axes.up + step.z * axes.forward;
  Camera result = camera;
  result.position += shift;
  result.focal_point += shift;
  return result;
}

Camera withOtherProjection(const Camera& camera) {
  Camera result = camera;
  const double tangent = halfAngleTangent(camera);
  if (camera.projection == Projection::kOrthographic) {
    const glm::dvec3 towards_viewer = -axesOf(camera).forward;
    result.projection = Projection::kPerspective;
    result.position = camera.focal_point + camera.parallel_scale / tangent * towards_viewer;
  } else {
    result.projection = Projection::kOrthographic;
    result.parallel_scale = distanceOf(camera) * tangent;
  }
  return result;
}

Camera holding(const Camera& camera, ImageSize from, ImageSize to) {
  const auto aspect = [](ImageSize size) { return static_cast<double>(size.width) / size.height; };
  const double factor = std::max(1.0, aspect(from) / aspect(to));  // a narrower one has to be higher
  Camera result = camera;
  result.parallel_scale *= factor;
  result.view_angle_deg = glm::degrees(2 * std::atan(factor * halfAngleTangent(camera)));
  return result;
}

Camera refitted(const Camera& camera, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) {
  const ViewAxes axes = axesOf(camera);
  const double radius = std::max(glm::length(upper - lower) / 2, 1e-300);
  const double narrower = std::min(1.0, static_cast<double>(size.width) / size.height);
  const double half_angle = std::atan(halfAngleTangent(camera) * narrower);
  Camera result = camera;
  result.focal_point = 0.5 * (lower + upper);
  result.position = result.focal_point - radius / std::sin(half_angle) * axes.forward;
  result.view_up = axes.up;
  result.parallel_scale = result.parallelScaleFor(lower, upper, size);
  return result;
}

}  // namespace curvisplat
