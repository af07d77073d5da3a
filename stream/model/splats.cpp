#include "stream/model/splats.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "stream/model/border_code.h"
#include "stream/model/kernel.h"

namespace curvisplat {

void SplatGeometry::resize(size_t count) {
  forEachArrayOfGeometry(*this, [&](auto& array) { array.resize(count); });
}

void SplatVariable::resize(size_t count) {
  forEachArrayOfVariable(*this, [&](auto& array) { array.resize(count); });
}

GeometryArrays<float> arraysOf(SplatGeometry& g) {
  return {g.x.data(),           g.y.data(),           g.z.data(),       g.axis0.data(),   g.axis1.data(),
          g.axis2.data(),       g.shear10.data(),     g.shear20.data(), g.shear21.data(), g.weight.data(),
          g.border_code.data(), g.growth_code.data(), g.size()};
}

VariableArrays<float> arraysOf(SplatVariable& v) {
  return {v.mean.data(), v.slope0.data(), v.slope1.data(), v.slope2.data(), v.variance.data(), v.size()};
}

GeometryArrays<const float> arraysOf(const SplatGeometry& g) {
  return {g.x.data(),           g.y.data(),           g.z.data(),       g.axis0.data(),   g.axis1.data(),
          g.axis2.data(),       g.shear10.data(),     g.shear20.data(), g.shear21.data(), g.weight.data(),
          g.border_code.data(), g.growth_code.data(), g.size()};
}

VariableArrays<const float> arraysOf(const SplatVariable& v) {
  return {v.mean.data(), v.slope0.data(), v.slope1.data(), v.slope2.data(), v.variance.data(), v.size()};
}

void copyGeometry(const GeometryArrays<const float>& from, const GeometryArrays<float>& to) {
  const std::array floats{std::pair(from.x, to.x),
                          std::pair(from.y, to.y),
                          std::pair(from.z, to.z),
                          std::pair(from.axis0, to.axis0),
                          std::pair(from.axis1, to.axis1),
                          std::pair(from.axis2, to.axis2),
                          std::pair(from.shear10, to.shear10),
                          std::pair(from.shear20, to.shear20),
                          std::pair(from.shear21, to.shear21),
                          std::pair(from.weight, to.weight)};
  for (const auto& array : floats) std::copy_n(array.first, from.count, array.second);
  std::copy_n(from.border_code, from.count, to.border_code);
  std::copy_n(from.growth_code, from.count, to.growth_code);
}

void copyValues(const VariableArrays<const float>& from, const VariableArrays<float>& to) {
  std::copy_n(from.mean, from.count, to.mean);
  std::copy_n(from.slope0, from.count, to.slope0);
  std::copy_n(from.slope1, from.count, to.slope1);
  std::copy_n(from.slope2, from.count, to.slope2);
  std::copy_n(from.variance, from.count, to.variance);
}

namespace {

constexpr double kRounding = 1e-6;

/// The running maximum of the largest eigenvalues of L Lᵀ, L lower triangular (six entries).
class LargestEigenvalue {
 public:
  /// One that is larger than the largest so far by a ratio of less than 1 + `slack` may be left out.
  explicit LargestEigenvalue(double slack) : slack_(slack) {}

  void add(double l00, double l10, double l11, double l20, double l21, double l22) {
    const double xx = l00 * l00, xy = l10 * l00, yy = l10 * l10 + l11 * l11;
    const double xz = l20 * l00, yz = l20 * l10 + l21 * l11, zz = l20 * l20 + l21 * l21 + l22 * l22;
    constexpr double kBelowOne = 1 - 1e-12;
    // None is above the sum of all, which rules out those of the smaller splats before anything is divided.
    const double trace = xx + yy + zz;
    if (trace < kBelowOne * needed_) return;
    const double q = trace / 3;
    const double a = xx - q, b = yy - q, c = zz - q;
    const double p2 = (a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6;
    // The eigenvalues are q + 2 p cos(angle + 2/3 pi n): q + 2 p bounds them and rules out most, without p's
    // root.
    const double room = needed_ - q;
    if (room > 0 && 4 * p2 < kBelowOne * room * room) return;
    // None is above y + q if the characteristic polynomial of the matrix less q, and its derivative, are
    // positive at y > 0. With room for what rounding does near a double root.
    constexpr double kBelowRounding = 1 - 1e-7;
    const double determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    const double y = kBelowRounding * needed_ - q;
    if (y > 0 && y * y > p2 && y * (y * y - 3 * p2) > determinant) return;
    const double p = std::sqrt(p2);
    if (q + 2 * p <= needed_) return;
    const std::array<double, 6> matrix{xx, xy, yy, xz, yz, zz};
    if (matrix == computed_) return;  // rows of equal cells
    computed_ = matrix;
    double largest = q;
    if (p > 0) {
      const double s = 1 / p;
      const double A = a * s, B = b * s, C = c * s, D = xy * s, E = xz * s, F = yz * s;
      const double half_determinant = 0.5 * (A * (B * C - F * F) - D * (D * C - F * E) + E * (D * F - B * E));
      largest = q + 2 * p * std::cos(std::acos(std::clamp(half_determinant, -1.0, 1.0)) / 3);
    }
    best_ = std::max(best_, largest);
    needed_ = best_ * (1 + slack_);
  }
  double value() const { return best_ * (1 + kRounding); }

 private:
  double slack_, best_ = 0, needed_ = 0;
  std::array<double, 6> computed_{};  // last
};

}  // namespace

double largestSingularValue(std::span<const Splat> splats) {
  double unit = 0;  // scaled by it, so that neither tiny nor huge units under- or overflow
  const Splat* longest = nullptr;
  for (const Splat& splat : splats) {
    const double length = std::max({splat.axis[0], splat.axis[1], splat.axis[2]});
    if (length > unit) longest = &splat;
    unit = std::max(unit, length);
  }
  const double scale = 1 / unit;
  LargestEigenvalue largest(0);
  const auto add = [&](const Splat& splat) {
    const double a0 = splat.axis[0] * scale, a1 = splat.axis[1] * scale, a2 = splat.axis[2] * scale;
    largest.add(a0, a0 * splat.shear[0], a1, a0 * splat.shear[1], a1 * splat.shear[2], a2);
  };
  // First one that is likely to rule out most of the others.
  if (longest) add(*longest);
  for (const Splat& splat : splats) add(splat);
  return unit * std::sqrt(largest.value());
}

double smallestSingularValue(std::span<const Splat> splats, double slack) {
  double unit = std::numeric_limits<double>::infinity();
  const Splat* shortest = nullptr;
  for (const Splat& splat : splats) {
    const double length = std::min({splat.axis[0], splat.axis[1], splat.axis[2]});
    if (length < unit) shortest = &splat;
    unit = std::min(unit, length);
  }
  // 1 / the largest singular value of A⁻¹, from the triangular inverse: exact where S⁻¹ would not be.
  LargestEigenvalue largest((1 + slack) * (1 + slack) - 1);
  const auto add = [&](const Splat& splat) {
    const double b0 = unit / splat.axis[0], b1 = unit / splat.axis[1], b2 = unit / splat.axis[2];
    const double l10 = splat.shear[0], l20 = splat.shear[1], l21 = splat.shear[2];
    largest.add(b0, -b1 * l10, b1, b2 * (l10 * l21 - l20), -b2 * l21, b2);
  };
  if (shortest) add(*shortest);
  for (const Splat& splat : splats) add(splat);
  return unit / std::sqrt(largest.value());
}

double largestReach(std::span<const Splat> splats, std::span<const uint32_t> border_codes) {
  const double largest = largestSingularValue(splats);
  double beyond = 0;
  for (size_t n = 0; n < border_codes.size(); ++n) {
    if (border_codes[n] == kNoBorder) continue;
    const InwardAxes inward = inwardAxes(border_codes[n]);
    const double length =
        inward.ratio > 0 ? glm::length(splats[n].factor() * glm::dvec3(inward.axis[0])) : largest;
    beyond = std::max(beyond, borderReach(border_codes[n]) * length);
  }
  return kKernelSupport * largest + beyond;
}

}  // namespace curvisplat
