#include "preprocess/shape/covered_part.h"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>

namespace curvisplat {
namespace {

constexpr double kPartVariance = 1.0 / 256;  // of a sixteenth of a cell, times 12

// A part is cut at its end like the half cell at a border. In slices of whole cells, and in those that are
// nearly whole, too few points say where that end is.
constexpr double kMinCut = 0.1;     // of the cell
constexpr double kMinShift = 1e-3;  // of the middle, in cells: the rest may lie around what is covered

/// 12 times the covariance of the points that are left, and of the part of the cell that each stands for; of
/// all points the identity.
struct PartMoments {
  double share = 0;
  glm::dvec3 middle{0.0};
  glm::dmat3 shape{0.0};
};

/// How far from the cell's middle, against `inward` (unit length, along i, j, k), a plane parts the points
/// that are covered from the others: as many of all points lie beyond it as are covered.
double planeDistance(uint64_t covered, const glm::dvec3& inward) {
  std::array<double, kCellPoints> along;
  std::transform(cellPoints().begin(), cellPoints().end(), along.begin(),
                 [&](const glm::dvec3& point) { return -glm::dot(inward, point); });
  std::sort(along.begin(), along.end(), std::greater<>());
  const auto beyond = static_cast<size_t>(std::popcount(covered));
  return 0.5 * (along[beyond - 1] + along[beyond]);
}

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

/// The remainder of a cell, in its lattice's directions.
struct Remainder {
  PartMoments part;
  double shift = 0;       // how far its middle is from the cell's
  bool has_face = false;  // else it lies around what is covered
  double to_face = 0;     // from its middle, away from it
};

Remainder remainderOf(uint64_t covered) {
  Remainder rest{momentsOf(~covered)};
  rest.shift = glm::length(rest.part.middle);
  rest.has_face = rest.shift > kMinShift;
  // The face between the blocks is about at right angles to where the rest's middle is.
  if (rest.has_face) rest.to_face = rest.shift + planeDistance(covered, rest.part.middle / rest.shift);
  return rest;
}

/// The same, from a table where whole octants are covered: beside blanked cells.
Remainder knownRemainderOf(uint64_t covered) {
  constexpr size_t kSets = size_t{1} << kCellOctantCount;  // of octants; not none, and not all of them
  static const std::array<Remainder, kSets> of_octants = [] {
    std::array<Remainder, kSets> all;
    for (size_t set = 1; set < kSets - 1; ++set) {
      uint64_t points = 0;
      for (size_t octant = 0; octant < kCellOctantCount; ++octant)
        if (set >> octant & 1) points |= octantPoints(octant);
      all[set] = remainderOf(points);
    }
    return all;
  }();
  size_t set = 0;
  for (size_t octant = 0; octant < kCellOctantCount; ++octant) {
    const uint64_t points = covered & octantPoints(octant);
    if (points == octantPoints(octant))
      set |= size_t{1} << octant;
    else if (points != 0)
      return remainderOf(covered);
  }
  return of_octants[set];
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

/// L⁻¹ v.
glm::dvec3 solved(const glm::dmat3& lower, const glm::dvec3& v) {
  const double x = v.x / lower[0][0], y = (v.y - lower[0][1] * x) / lower[1][1];
  return {x, y, (v.z - lower[0][2] * x - lower[1][2] * y) / lower[2][2]};
}

/// The face between the blocks: where it is seen from a part's middle, in the frame of its own A.
struct PartFace {
  glm::dvec3 inward{0.0};  // unit length; zero if there is none
  double distance = 0.5;   // in lengths of the part
  bool is_sure = false;    // enough points tell
};

/// How a part ends. Where that is where the whole cell ended, the border's direction is better known than
/// the points tell.
uint32_t borderOf(const glm::dmat3& lower, PartFace face, const CoveredCell& cell) {
  constexpr double kAlong = 0.7;  // cosine of directions that are about the same
  const InwardAxes whole = inwardAxes(cell.border_code);
  std::array<glm::dvec3, 3> axes;
  size_t count = 0;
  uint32_t faces = 0;
  bool at_border = false;
  for (int n = 0; n < whole.count && !whole.behind; ++n) {
    const glm::dvec3 axis = glm::normalize(solved(lower, glm::dvec3(whole.axis[static_cast<size_t>(n)])));
    const double along = glm::dot(axis, face.inward);
    if (along < -kAlong) return kNoBorder;  // between two faces
    if (whole.hasFace(n)) faces |= 1u << count;
    axes[count++] = axis;
    if (along <= kAlong) continue;
    face = {axis, 0.5, true};
    at_border = true;
  }
  if (face.is_sure && count == (at_border ? 1 : 0)) {
    // Cells behind the face are longer than what is left of this one.
    const double next = (at_border ? cell.next : 1) / glm::length(lower * face.inward);
    return packMergedCode(face.inward, face.distance, next / (2 * face.distance));
  }
  if (face.is_sure && !at_border && count < 3) {
    faces |= 1u << count;
    axes[count++] = face.inward;
  }
  for (size_t n = 1; n < count; ++n) {
    for (size_t m = 0; m < n; ++m) axes[n] -= glm::dot(axes[n], axes[m]) * axes[m];
    axes[n] = glm::normalize(axes[n]);
  }
  return packBorderCode({axes.data(), count}, faces);
}

}  // namespace

const std::array<glm::dvec3, kCellPoints>& cellPoints() {
  static const std::array<glm::dvec3, kCellPoints> points = [] {
    std::array<glm::dvec3, kCellPoints> all;
    for (size_t n = 0; n < kCellPoints; ++n) {
      const size_t octant = n / 8, m = n % 8;
      // A lattice of eight points, in each octant its mirror image: their mean is 0, and no axes are
      // correlated.
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

std::optional<uint32_t> keepUncovered(const CoveredCell& cell, Splat& splat, std::span<SplatScalar> values) {
  if (cell.covered == 0) return cell.border_code;
  if (cell.covered == kAllCovered) return std::nullopt;
  Remainder rest = knownRemainderOf(cell.covered);
  PartMoments& part = rest.part;
  part.middle = cell.axes * part.middle;
  part.shape = cell.axes * part.shape * glm::transpose(cell.axes);
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
  PartFace face;
  if (rest.has_face) {
    const glm::dvec3 inward =
        glm::transpose(lower) * part.middle / rest.shift;  // as long as the cell is to the part
    const double length = glm::length(inward);
    face = {inward / length, rest.to_face / length, part.share >= kMinCut && part.share <= 1 - kMinCut};
  }
  return borderOf(lower, face, cell);
}

}  // namespace curvisplat
