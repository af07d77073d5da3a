// The linear algebra of a splat's shape: 3x3, in double precision, and total. Singular, badly scaled and
// left-handed matrices are everyday input here (polar axes, boundary layers of aspect ratio 1e5), so
// nothing is squared that need not be, and nothing divides by a number that may be zero. Pure: any thread.
//
// A cell's Jacobian is factored as J = A Q: A lower triangular with a diagonal >= 0, Q orthogonal.
// LqFactors does that quickly, inline, since conversion needs it for every node; shapeFromJacobian()
// handles matrices of any rank.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cmath>

#include "stream/model/splats.h"

namespace curvisplat {

/// A lower triangular matrix.
struct Lower3 {
  double a00, a10, a11, a20, a21, a22;
};

/// J = A Q by one Householder reflection of J's rows and one plane rotation: backward stable whatever the
/// rank, where the Cholesky factor of J Jᵀ has lost everything at an aspect ratio of 1e8. A row that is
/// zero where it should be eliminated takes the identity, so Q is always orthogonal.
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

/// The smallest axis of a splat, relative to its largest: singular values of A below are raised to it.
/// Thinner cells than this are degenerate; cells of a boundary layer (1e-5) are not, and stay as they are.
inline constexpr double kAxisFloor = 1e-6;

/// A symmetric matrix: its lower triangle.
struct Symmetric3 {
  double xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, zz = 0;
};

/// The shape of a cell: A and the rotation that belongs to it, from J = A Q.
struct CellShape {
  std::array<double, 3> axis;   // as Splat's
  std::array<double, 3> shear;  // as Splat's
  glm::dmat3 rotation;          // Q, orthogonal, GLM's columns. The slope is Q ∇_c f
  double determinant;           // of J as it came, with its sign; 0 if J is singular up to rounding
  bool floored;                 // a singular value was raised
};

/// A and Q from a Jacobian of any rank, its singular values raised to kAxisFloor of the largest. The zero
/// matrix gives `smallest` (> 0) on A's diagonal. Throws nothing.
CellShape shapeFromJacobian(const glm::dmat3& jacobian, double smallest);

/// A (into `splat`'s axis and shear) from S = A Aᵀ, positive semi-definite up to rounding. The floor as
/// above.
void setShape(Splat& splat, const Symmetric3& s, double smallest);

/// A⁻¹ v: a vector in the frame of a splat, where its cell is the unit cube.
glm::dvec3 inFrameOf(const Splat& splat, const glm::dvec3& v);
/// A⁻ᵀ w: for a slope w the gradient, its change per world unit; for a unit vector w of the frame the normal
/// of the cell's face at right angles to it, one over the cell's thickness long.
glm::dvec3 gradientOf(const Splat& splat, const glm::dvec3& w);

/// S = A Aᵀ of a splat.
Symmetric3 shapeMatrix(const Splat& splat);

/// `s` with its eigenvalues raised to `least` (> 0).
Symmetric3 raisedTo(const Symmetric3& s, double least);

/// The singular values of `m`, largest first: the semi-axes of the ellipsoid that `m` makes of the unit
/// sphere. Those of a splat are singularValues(splat.factor()). Exact to a few units in the last place of
/// each for matrices whose columns are badly scaled, and of the largest otherwise.
std::array<double, 3> singularValues(const glm::dmat3& m);

/// True only if every singular value of `a` is above kAxisFloor times the largest: with singular values s0
/// >= s1 >= s2, s2 = det / (s0 s1) >= det / ‖adj a‖ and s0 <= ‖a‖ (Frobenius norms). Says no from an aspect
/// ratio of a third of the limit on, and for lengths whose sixth power leaves the range of double; those are
/// for the slow and exact way.
inline bool surelyAboveFloor(const Lower3& a) {
  const double norm2 =
      a.a00 * a.a00 + a.a10 * a.a10 + a.a11 * a.a11 + a.a20 * a.a20 + a.a21 * a.a21 + a.a22 * a.a22;
  const double c0 = a.a11 * a.a22, c1 = a.a10 * a.a22, c2 = a.a10 * a.a21 - a.a11 * a.a20;
  const double c3 = a.a00 * a.a22, c4 = a.a00 * a.a21, c5 = a.a00 * a.a11;
  const double adjugate2 = c0 * c0 + c1 * c1 + c2 * c2 + c3 * c3 + c4 * c4 + c5 * c5;
  const double determinant = c5 * a.a22;
  constexpr double kMargin = 1.01;  // for the rounding of c2
  return determinant * determinant > kMargin * kAxisFloor * kAxisFloor * norm2 * adjugate2;
}

/// J = A Q of a cell whose singular values are surely above the floor: the quick way, without one of them
/// computed.
struct PlainFrame {
  static constexpr bool kIsPlain = true;
  const LqFactors& lq;

  glm::dvec3 rotate(const glm::dvec3& v) const { return lq.rotate(v); }
  /// A⁻¹ v.
  glm::dvec3 inFrame(const glm::dvec3& v) const {
    const Lower3& a = lq.lower;
    const double v0 = v.x * lq.inverse_a00, v1 = (v.y - a.a10 * v0) * lq.inverse_a11;
    return {v0, v1, (v.z - a.a20 * v0 - a.a21 * v1) / a.a22};
  }
  double determinant() const { return lq.determinant; }
  bool floored() const { return false; }
};

/// The same of any other cell.
struct AnyFrame {
  static constexpr bool kIsPlain = false;
  const CellShape& shape;

  glm::dvec3 rotate(const glm::dvec3& v) const { return shape.rotation * v; }
  double determinant() const { return shape.determinant; }
  bool floored() const { return shape.floored; }
};

/// Sets axis and shear of `splat` from a Jacobian of any rank, then calls `use` with the cell's frame, a
/// PlainFrame or an AnyFrame. `smallest()`: as shapeFromJacobian's.
template <typename Smallest, typename Use>
void splatFromJacobian(const glm::dmat3& jacobian, Splat& splat, const Smallest& smallest, const Use& use) {
  const LqFactors lq({jacobian[0].x, jacobian[1].x, jacobian[2].x},
                     {jacobian[0].y, jacobian[1].y, jacobian[2].y},
                     {jacobian[0].z, jacobian[1].z, jacobian[2].z});
  const Lower3& a = lq.lower;
  if (surelyAboveFloor(a)) {
    splat.axis = {a.a00, a.a11, a.a22};
    splat.shear = {a.a10 * lq.inverse_a00, a.a20 * lq.inverse_a00, a.a21 * lq.inverse_a11};
    use(PlainFrame{lq});
  } else {
    const CellShape shape = shapeFromJacobian(jacobian, smallest());
    splat.axis = shape.axis;
    splat.shear = shape.shear;
    use(AnyFrame{shape});
  }
}

}  // namespace curvisplat
