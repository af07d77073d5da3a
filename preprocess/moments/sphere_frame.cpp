#include "preprocess/moments/sphere_frame.h"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace curvisplat {

SphereFrame::SphereFrame(const glm::dvec3& at) : radius_(glm::length(at)) {
  if (radius_ > 0 && std::isfinite(radius_)) up_ = at / radius_;
}

SphereFrame SphereFrame::ofMiddle(std::span<const glm::dvec3> corners) {
  constexpr double kFarthest = 0.5;  // cosine
  glm::dvec3 sum(0.0);
  double radius = 0;
  for (const glm::dvec3& corner : corners) {
    sum += corner;
    radius += glm::length(corner);
  }
  SphereFrame frame(sum);
  frame.radius_ = radius / static_cast<double>(corners.size());
  const bool near = std::all_of(corners.begin(), corners.end(), [&](const glm::dvec3& corner) {
    return glm::dot(frame.up_, corner) > kFarthest * glm::length(corner);
  });
  return near ? frame : SphereFrame();
}

glm::dvec3 SphereFrame::flat(const glm::dvec3& x) const {
  const double length = glm::length(x);
  if (isFlat() || !(length > 0)) return x;
  const glm::dvec3 across = x - glm::dot(up_, x) * up_;
  return radius_ / length * across + length * up_;
}

glm::dvec3 SphereFrame::bent(const glm::dvec3& x) const {
  if (isFlat()) return x;
  const double height = glm::dot(up_, x);
  const glm::dvec3 across = (x - height * up_) / radius_;
  const double sine = glm::length(across);
  if (sine >= 1) return height / sine * across;
  return height * (across + std::sqrt((1 - sine) * (1 + sine)) * up_);
}

glm::dmat3 SphereFrame::turnTo(const SphereFrame& other) const {
  const double cosine = glm::dot(up_, other.up_);
  if (isFlat() || other.isFlat() || !(cosine > -1)) return glm::dmat3(1.0);
  const glm::dvec3 v = glm::cross(up_, other.up_);
  const glm::dmat3 cross(0, v.z, -v.y, -v.z, 0, v.x, v.y, -v.x, 0);
  return glm::dmat3(1.0) + cross + cross * cross / (1 + cosine);
}

Symmetric3 turned(const Symmetric3& shape, const glm::dmat3& by) {
  const glm::dmat3 s(shape.xx, shape.xy, shape.xz, shape.xy, shape.yy, shape.yz, shape.xz, shape.yz,
                     shape.zz);
  const glm::dmat3 t = by * s * glm::transpose(by);
  return {t[0][0], t[1][0], t[1][1], t[2][0], t[2][1], t[2][2]};
}

}  // namespace curvisplat
