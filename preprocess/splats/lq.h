// J = A Q for 3x3 matrices: A lower triangular with a diagonal >= 0, Q orthogonal. Inline, since conversion
// does it for every node.
//
// One Householder reflection of J's rows and one plane rotation: backward stable whatever the rank, where the
// Cholesky factor of J Jᵀ has lost everything at an aspect ratio of 1e8. A row that is zero where it should
// be eliminated takes the identity, so Q is orthogonal always.
#pragma once

#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace curvisplat {

struct Lower3 {
  double a00, a10, a11, a20, a21, a22;
};

class LqFactors {
 public:
  Lower3 lower;
  double determinant;  // of J
  double inverse_a00;  // 1 / lower.a00 and 1 / lower.a11; 0 where those are 0
  double inverse_a11;

  /// Rows of J, each over (i, j, k).
  LqFactors(const glm::dvec3& x, const glm::dvec3& y, const glm::dvec3& z) {
    const double length = std::sqrt(x.x * x.x + x.y * x.y + x.z * x.z);
    const double side = x.x < 0 ? -1.0 : 1.0;
    reflector_ = {x.x + side * length, x.y, x.z};
    inverse_a00 = length > 0 ? 1 / length : 0.0;
    scale_ = length > 0 ? inverse_a00 / (length + std::abs(x.x)) : 0.0;
    first_sign_ = length > 0 ? -side : 1.0;

    const glm::dvec3 y1 = reflect(y), z1 = reflect(z);
    const double second = std::sqrt(y1.y * y1.y + y1.z * y1.z);
    inverse_a11 = second > 0 ? 1 / second : 0.0;
    cosine_ = second > 0 ? y1.y * inverse_a11 : 1.0;
    sine_ = y1.z * inverse_a11;
    const double third = cosine_ * z1.z - sine_ * z1.y;
    last_sign_ = third < 0 ? -1.0 : 1.0;

    lower = {length, y1.x, second, z1.x, cosine_ * z1.y + sine_ * z1.z, std::abs(third)};
    determinant = side * length * second * third;
  }

  /// Q v.
  glm::dvec3 rotate(const glm::dvec3& v) const {
    const glm::dvec3 r = reflect(v);
    return {r.x, cosine_ * r.y + sine_ * r.z, last_sign_ * (cosine_ * r.z - sine_ * r.y)};
  }

 private:
  glm::dvec3 reflect(const glm::dvec3& v) const {
    const double along = scale_ * (v.x * reflector_.x + v.y * reflector_.y + v.z * reflector_.z);
    return {first_sign_ * (v.x - along * reflector_.x), v.y - along * reflector_.y,
            v.z - along * reflector_.z};
  }

  glm::dvec3 reflector_;
  double scale_, first_sign_;
  double cosine_, sine_, last_sign_;
};

}  // namespace curvisplat
