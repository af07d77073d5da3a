#include "preprocess/splats/covered_part.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

namespace curvisplat {
namespace {

constexpr double kPartVariance = 1.0 / 256;  // of a sixteenth of a cell, times 12

// A part is cut at its end like the half cell at a border, but for slices and cells that are nearly whole.
constexpr double kLeastCut = 0.15;    // of the cell
constexpr double kLeastShift = 1e-3;  // of the middle, in cells: the rest may lie around what is covered

/// 12 times the covariance of the points that are left, and of the part of the cell that each stands for; of all
/// points the identity.
struct PartMoments {
  double share = 0;
  glm::dvec3 middle{0.0};
  glm::dmat3 shape{0.0};
};

PartMoments momentsOf(uint64_t left) {
  const auto& points = cellPoints();
  PartMoments part;
  const int count = std::popcount(left);
  part.share = count / static_cast<double>(kCellPoints);
  for (uint64_t bits = left; bits != 0; bits &= bits - 1)
    part.middle += points[static_cast<size_t>(std::countr_zero(bits))];
  part.middle /= count;
  for (uint64_t bits = left; bits != 0; bits &= bits - 1) {
    const glm::dvec3 e = points[static_cast<size_t>(std::countr_zero(bits))] - part.middle;
    for (int column = 0; column < 3; ++column) part.shape[column] += e[column] * e;
  }
  part.shape *= 12.0 / count;
  for (int axis = 0; axis < 3; ++axis) part.shape[axis][axis] += kPartVariance;
  return part;
}

/// L of M = L Lᵀ.
glm::dmat3 choleskyOf(const glm::dmat3& m) {
  glm::dmat3 l(0.0);
  for (int column = 0; column < 3; ++column)
    for (int row = column; row < 3; ++row) {
      double sum = m[column][row];
      for (int n = 0; n < column; ++n) sum -= l[n][row] * l[n][column];
      l[column][row] = row == column ? std::sqrt(std::max(sum, kPartVariance / 4)) : sum / l[column][column];
    }
  return l;
}

}  // namespace

const std::array<glm::dvec3, kCellPoints>& cellPoints() {
  static const std::array<glm::dvec3, kCellPoints> points = [] {
    std::array<glm::dvec3, kCellPoints> all;
    for (size_t n = 0; n < kCellPoints; ++n) {
      const size_t octant = n / 8, m = n % 8;
      // A lattice of eight points, in each octant its mirror image: their mean is 0, and no axes are correlated.
      const std::array<size_t, 3> step{m, 3 * m % 8, 5 * m % 8};
      for (int axis = 0; axis < 3; ++axis) {
        const double distance = (2.0 * static_cast<double>(step[static_cast<size_t>(axis)]) + 1) / 32;
        all[n][axis] = (octant >> axis & 1) != 0 ? -distance : distance;
      }
    }
    return all;
  }();
  return points;
}

std::optional<uint32_t> keepUncovered(uint64_t covered, const glm::dmat3& axes, Splat& splat,
                                      std::span<SplatScalar> values) {
  if (covered == 0) return kNoBorder;
  if (covered == kAllCovered) return std::nullopt;
  PartMoments part = momentsOf(~covered);
  part.middle = axes * part.middle;
  part.shape = axes * part.shape * glm::transpose(axes);
  const glm::dmat3 lower = choleskyOf(part.shape);
  const glm::dmat3 factor = splat.factor() * lower;
  splat.position += splat.factor() * part.middle;
  splat.axis = {factor[0][0], factor[1][1], factor[2][2]};
  splat.shear = {factor[0][1] / factor[0][0], factor[0][2] / factor[0][0], factor[1][2] / factor[1][1]};
  splat.weight *= part.share;
  for (SplatScalar& value : values) {
    value.mean += glm::dot(value.slope, part.middle);
    value.slope = glm::transpose(lower) * value.slope;
  }
  // The face between the blocks is about at right angles to where the rest's middle is.
  const glm::dvec3 inward = glm::transpose(lower) * part.middle;
  const double length = glm::length(inward);
  if (part.share < kLeastCut || part.share > 1 - kLeastCut || !(length > kLeastShift)) return kNoBorder;
  const std::array<glm::dvec3, 1> axis{inward / length};
  return packBorderCode(axis, 1);
}

}  // namespace curvisplat
