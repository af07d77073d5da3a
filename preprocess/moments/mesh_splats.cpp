#include "preprocess/moments/mesh_splats.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include "preprocess/shape/merge.h"
#include "preprocess/shape/sample_range.h"
#include "preprocess/shape/shape.h"
#include "stream/model/growth_code.h"

namespace curvisplat {
namespace {

// A direction that the neighbours cover less than this, of the best covered one, has no slope.
constexpr double kMinCover = 1e-3;

// Squares of what is left beside the diagonal, of the trace's.
constexpr double kConverged = 1e-30;

/// A length for the shape of a splat without any extent: far below the grid's, and above zero.
double smallestAxis(const glm::dvec3& centre) {
  const glm::dvec3 here = glm::abs(centre);
  const double length = std::max({here.x, here.y, here.z});
  return std::max(kAxisFloor * (length > 0 ? length : 1.0), std::numeric_limits<double>::min());
}

void setBody(uint64_t node, const glm::dvec3& centre, double volume, const Symmetric3& shape,
             NodeSplat& splat) {
  splat = {};
  splat.node = node;
  splat.splat.position = splat.node_position = centre;
  splat.splat.weight = volume;
  setShape(splat.splat, shape, smallestAxis(centre));
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi's rotations.
void eigenvectorsOf(std::array<std::array<double, 3>, 3>& a, std::array<std::array<double, 3>, 3>& v) {
  v = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  for (int sweep = 0; sweep < 12; ++sweep) {
    const double trace = a[0][0] + a[1][1] + a[2][2];
    const double rest = a[0][1] * a[0][1] + a[0][2] * a[0][2] + a[1][2] * a[1][2];
    if (!(rest > kConverged * trace * trace)) return;
    for (size_t p = 0; p < 2; ++p)
      for (size_t q = p + 1; q < 3; ++q) {
        if (a[p][q] == 0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t = std::copysign(1.0, theta) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (size_t k = 0; k < 3; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq;
          a[k][q] = s * kp + c * kq;
        }
        for (size_t k = 0; k < 3; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk;
          a[q][k] = s * pk + c * qk;
          const double vp = v[k][p], vq = v[k][q];
          v[k][p] = c * vp - s * vq;
          v[k][q] = s * vp + c * vq;
        }
      }
  }
}

}  // namespace

void splatOfPoint(uint64_t node, const DualCell& dual, NodeSplat& splat, std::span<SplatScalar> values) {
  const std::span<const double> m = dual.moments;
  const bool solid = m[0] > 0;
  const double share = solid ? 1 / m[0] : 0.0;
  const glm::dvec3 mean(share * m[1], share * m[2], share * m[3]);
  const auto shape = [&](size_t sum, int i, int j) { return 12 * (share * m[sum] - mean[i] * mean[j]); };
  setBody(node, dual.point + mean, m[0],
          {shape(4, 0, 0), shape(5, 0, 1), shape(6, 1, 1), shape(7, 0, 2), shape(8, 1, 2), shape(9, 2, 2)},
          splat);
  splat.node_position = dual.point;
  for (size_t field = 0; field < values.size(); ++field) {
    const double* of_field = m.data() + 10 + 5 * field;
    const double g = share * of_field[0];
    const glm::dvec3 h = 12.0 * (share * glm::dvec3(of_field[1], of_field[2], of_field[3]) - g * mean);
    const double variance = std::max(0.0, share * of_field[4] - g * g);
    // A slope never explains more than the variance there is; rounding, or a floored axis, may say so.
    glm::dvec3 slope = inFrameOf(splat.splat, h);
    const double explained = glm::dot(slope, slope) / 12;
    if (explained > variance) slope *= std::sqrt(variance / explained);
    values[field] = {dual.values[field] + g, slope, 0.0};
  }
}

void leastSquares(const CellNeighbours& neighbours, std::span<const float> own, std::span<glm::dvec3> out) {
  const size_t fields = own.size();
  std::array<std::array<double, 3>, 3> a{};
  std::fill(out.begin(), out.end(), glm::dvec3(0.0));
  for (size_t n = 0; n < neighbours.steps.size(); ++n) {
    const glm::dvec3& step = neighbours.steps[n];
    const double square = glm::dot(step, step);
    if (!(square > 0)) continue;
    const glm::dvec3 d = step / square;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        a[static_cast<size_t>(row)][static_cast<size_t>(column)] += d[row] * step[column];
    for (size_t field = 0; field < fields; ++field)
      out[field] += (static_cast<double>(neighbours.values[n * fields + field]) - own[field]) * d;
  }
  // With eigenvalues p >= q >= r > 0, r / p is at least 2 p q r / (p + q + r)³: then every direction counts.
  const glm::dmat3 m(a[0][0], a[0][1], a[0][2], a[1][0], a[1][1], a[1][2], a[2][0], a[2][1], a[2][2]);
  const double trace = a[0][0] + a[1][1] + a[2][2];
  if (2 * glm::determinant(m) > kMinCover * trace * trace * trace) {
    const glm::dmat3 inverse = glm::inverse(m);
    for (glm::dvec3& gradient : out) gradient = inverse * gradient;
    return;
  }
  std::array<std::array<double, 3>, 3> v;
  eigenvectorsOf(a, v);
  const double most = std::max({a[0][0], a[1][1], a[2][2]});
  for (size_t field = 0; field < fields; ++field) {
    const glm::dvec3 right = out[field];
    out[field] = glm::dvec3(0.0);
    for (size_t n = 0; n < 3; ++n) {
      if (!(a[n][n] > kMinCover * most)) continue;
      const glm::dvec3 direction(v[0][n], v[1][n], v[2][n]);
      out[field] += glm::dot(direction, right) / a[n][n] * direction;
    }
  }
}

namespace {

constexpr double kSimilar = 0.7;  // cosine: of one plane

/// An axis of a cell along which some neighbours are larger or smaller.
struct SizedAxis {
  glm::dvec3 normal{0.0};
  /// One side of the axis has the area of those neighbours, and the sum of the logarithms to base 2 of lengths over the cell's.
  struct End {
    double area = 0, growth = 0;
    double mean() const { return area > 0 ? growth / area : 0; }
  };
  std::array<End, 2> ends;

  template <typename Of>
  double difference(const Of& of) const {
    return of(ends[0].mean()) - of(ends[1].mean());
  }
};

std::vector<SizedAxis> axesOf(std::span<const CellSide> sides, const glm::dvec3& centre) {
  std::vector<SizedAxis> axes;
  for (const CellSide& side : sides) {
    const double area = glm::length(side.outward);
    const glm::dvec3 normal = side.outward / area;
    const double own = glm::dot(side.face - centre, normal),
                 other = glm::dot(side.neighbour - side.face, normal);
    if (!(area > 0 && own > 0 && other > 0)) continue;
    auto axis = std::ranges::find_if(
        axes, [&](const SizedAxis& known) { return std::abs(glm::dot(known.normal, normal)) > kSimilar; });
    if (axis == axes.end()) {
      if (axes.size() == 3) continue;
      axis = axes.insert(axes.end(), {normal, {}});
    }
    SizedAxis::End& end = axis->ends[glm::dot(axis->normal, normal) > 0 ? 0 : 1];
    end.area += area;
    end.growth += area * std::clamp(std::log2(other / own), -1.0, 1.0);
  }
  return axes;
}

/// The growth code of a splat that grows along the normals of some faces, by each. A normal that lies near the plane
/// of those before it, as that of a prism's third side does, is left out.
uint32_t growthCodeOf(const std::array<glm::dvec3, 3>& normals, const std::array<double, 3>& growth,
                      const Splat& splat) {
  constexpr double kMinLeft = 0.1;  // of the length, beside the axes before it
  std::array<glm::dvec3, 3> frame{};
  std::array<double, 3> of_frame{};
  size_t count = 0;
  for (size_t n = 0; n < normals.size(); ++n) {
    const glm::dvec3 whole = normals[n] * splat.factor();
    glm::dvec3 axis = whole;
    for (size_t m = 0; m < count; ++m) axis -= glm::dot(frame[m], axis) * frame[m];
    const double left = glm::length(axis);
    if (growth[n] == 0 || !(left > kMinLeft * glm::length(whole))) continue;
    frame[count] = axis / left;
    of_frame[count++] = growth[n];
  }
  return packGrowthCode(frame, of_frame);
}

/// The growth code of a half of a splat, whose frame is another one.
uint32_t growthCodeOfHalf(const NodeSplat& whole, const Splat& half) {
  if (whole.growth_code == kNoGrowth) return kNoGrowth;
  const CellGrowth of_whole = cellGrowth(whole.growth_code);
  std::array<glm::dvec3, 3> normals;
  std::array<double, 3> growth;
  for (size_t n = 0; n < 3; ++n) {
    normals[n] = gradientOf(whole.splat, glm::dvec3(of_whole.axis[n]));
    growth[n] = of_whole.growth[n];
  }
  return growthCodeOf(normals, growth, half);
}

}  // namespace

void fitToSizes(std::span<const CellSide> sides, NodeSplat& of_cell) {
  Splat& splat = of_cell.splat;
  const std::vector<SizedAxis> axes = axesOf(sides, splat.position);
  if (axes.empty()) return;
  const auto perGrowth = [](double of_larger, double of_smaller) {
    return [=](double growth) { return growth * (growth > 0 ? of_larger : of_smaller); };
  };
  const auto length = perGrowth(kBesideLarger.length, -kBesideSmaller.length);
  const auto shift = perGrowth(kBesideLarger.shift, kBesideSmaller.shift);
  const auto skew = perGrowth(kBesideLarger.growth, kBesideSmaller.growth);
  const glm::dmat3 factor = splat.factor();
  glm::dmat3 shape = factor * glm::transpose(factor);
  glm::dvec3 moved(0.0);
  for (const SizedAxis& axis : axes) {
    const glm::dvec3 reach = shape * axis.normal;
    const glm::dvec3 along = reach / std::sqrt(glm::dot(axis.normal, reach));  // from face to face
    const double longer = length(axis.ends[0].mean()) + length(axis.ends[1].mean());
    moved += axis.difference(shift) * along;
    shape += std::expm1(2 * longer) * glm::outerProduct(along, along);
  }
  setShape(splat, {shape[0][0], shape[0][1], shape[1][1], shape[0][2], shape[1][2], shape[2][2]},
           smallestAxis(splat.position));
  splat.position += moved;
  std::array<glm::dvec3, 3> normals{};
  std::array<double, 3> growth{};
  for (size_t n = 0; n < axes.size(); ++n) {
    normals[n] = axes[n].normal;
    growth[n] = axes[n].difference(skew);
  }
  of_cell.growth_code = growthCodeOf(normals, growth, splat);
}

void splatOfCell(uint64_t node, const CellBody& body, std::span<const float> own,
                 const CellNeighbours& neighbours, NodeSplat& splat, std::span<SplatScalar> values) {
  setBody(node, body.centre, body.volume, {body.xx, body.xy, body.yy, body.xz, body.yz, body.zz}, splat);
  if (!neighbours.sides.empty() && body.volume > 0) fitToSizes(neighbours.sides, splat);
  const glm::dvec3 moved = splat.splat.position - body.centre;
  const size_t fields = own.size();
  std::vector<glm::dvec3> gradients(fields);
  leastSquares(neighbours, own, gradients);
  // The sum of |A⁻¹ d|² over the neighbours: what is left of their differences beyond the gradient is half
  // of it, times the mean second derivative along a column of A.
  double reach = 0;
  for (const glm::dvec3& step : neighbours.steps) {
    const glm::dvec3 in_cells = inFrameOf(splat.splat, step);
    reach += glm::dot(in_cells, in_cells);
  }
  for (size_t field = 0; field < fields; ++field) {
    double rest = 0;
    SampleRange range(own[field]);
    for (size_t n = 0; n < neighbours.steps.size(); ++n) {
      const float value = neighbours.values[n * fields + field];
      rest += (static_cast<double>(value) - own[field]) - glm::dot(gradients[field], neighbours.steps[n]);
      range.add(value);
    }
    const double second = reach > 0 ? 3 * 2 * rest / reach : 0.0;  // of all three columns
    // Since h = S g, the slope A⁻¹ h is Aᵀ g.
    values[field] = range.bounded({own[field] + kBend * second + glm::dot(gradients[field], moved),
                                   gradients[field] * splat.splat.factor(), 0.0});
  }
}

namespace {

constexpr double kEven = 0.9;  // the length of a mean of unit vectors that are about the same
constexpr size_t kMaxDirections = 16;

/// The planes of a cell or of the cells at a point, those of similar directions as one.
struct Directions {
  std::array<VoxelPlanes::Plane, kMaxDirections> places;
  size_t count = 0;

  std::span<const VoxelPlanes::Plane> all() const { return std::span(places).first(count); }
};

/// Joins planes of similar directions: of those that touch, or of those that do not.
Directions directionsOf(std::span<const OuterPlane> planes, bool touching) {
  Directions found;
  for (const OuterPlane& plane : planes) {
    if (plane.touches != touching) continue;
    const double area = glm::length(plane.inward);
    VoxelPlanes::Plane* same = nullptr;
    for (size_t n = 0; n < found.count && !same; ++n) {
      const glm::dvec3& sum = found.places[n].inward;
      if (glm::dot(sum, plane.inward) > kSimilar * glm::length(sum) * area) same = &found.places[n];
    }
    if (!same) {
      if (found.count == kMaxDirections) continue;
      same = &found.places[found.count++];
      *same = {glm::dvec3(0.0), glm::dvec3(0.0), 0, 0, true};
    }
    same->inward += plane.inward;
    same->point += area * plane.point;
    same->area += area;
  }
  for (VoxelPlanes::Plane& plane : std::span(found.places).first(found.count)) {
    const double length = glm::length(plane.inward);
    plane.face = length > kEven * plane.area;
    plane.inward /= length;
    plane.point /= plane.area;
  }
  return found;
}

/// The planes that touch, or do not, similar ones as one. A prism may have more sides than VoxelPlanes: then
/// those that are not closed, the largest first.
VoxelPlanes joined(std::span<const OuterPlane> planes, bool touching) {
  const Directions directions = directionsOf(planes, touching);
  const std::span<const VoxelPlanes::Plane> all = directions.all();
  std::array<VoxelPlanes::Plane, kMaxDirections> kept;
  auto end = all.size() > VoxelPlanes::kMax
                 ? std::copy_if(all.begin(), all.end(), kept.begin(),
                                [&](const VoxelPlanes::Plane& plane) { return !isClosed(plane, all); })
                 : std::copy(all.begin(), all.end(), kept.begin());
  if (end - kept.begin() > static_cast<ptrdiff_t>(VoxelPlanes::kMax)) {
    std::stable_sort(kept.begin(), end, [](const auto& a, const auto& b) { return a.area > b.area; });
    end = kept.begin() + VoxelPlanes::kMax;
  }
  VoxelPlanes found;
  found.count =
      static_cast<size_t>(std::copy(kept.begin(), end, found.planes.begin()) - found.planes.begin());
  for (size_t n = 0; n < found.count && !touching; ++n) found.planes[n].area = 0;
  return found;
}

/// The projection onto the directions along all outer faces that a splat ends at.
glm::dmat3 alongFaces(std::span<const OuterPlane> outer) {
  glm::dmat3 along(1.0);
  const Directions directions = directionsOf(outer, true);
  for (const VoxelPlanes::Plane& plane : directions.all()) {
    const glm::dvec3 rest = along * plane.inward;
    const double square = glm::dot(rest, rest);
    constexpr double kNew = 0.01;  // of the square of a normal: less is what earlier faces have left out
    if (square > kNew) along -= glm::outerProduct(rest, rest) / square;
  }
  return along;
}

}  // namespace

void fitAtHangingNode(std::span<const OuterPlane> outer, NodeSplat& of_point, std::span<SplatScalar> values) {
  Splat& splat = of_point.splat;
  if (!(splat.weight > 0)) return;
  const glm::dmat3 along = outer.empty() ? glm::dmat3(1.0) : alongFaces(outer);
  const glm::dvec3 aside = along * (splat.position - of_point.node_position);
  const glm::dvec3 in_cells = inFrameOf(splat, aside);
  const double square = std::min(glm::dot(in_cells, in_cells), kMostAside);
  const double one = std::clamp((square - kBothSidesUpTo) / (kOneSideFrom - kBothSidesUpTo), 0.0, 1.0);
  const auto mixed = [&](double of_one_side, double of_both) {
    return one * of_one_side + (1 - one) * of_both;
  };
  const double scale = square * mixed(kFitOfOneSide.scale, kFitOfBothSides.scale);
  const double blur = 12 * mixed(kFitOfOneSide.blur * square, kFitOfBothSides.blur);
  const double shift = mixed(std::min(kFitOfOneSide.shift * square, 1.0), kFitOfBothSides.shift);
  const Splat before = splat;
  const glm::dmat3 wider = glm::dmat3(1.0) + (std::exp(0.5 * scale) - 1) * along;
  const glm::dmat3 factor = wider * splat.factor();
  const glm::dmat3 shape = factor * glm::transpose(factor) + blur * glm::outerProduct(aside, aside);
  setShape(splat, {shape[0][0], shape[0][1], shape[1][1], shape[0][2], shape[1][2], shape[2][2]},
           smallestAxis(splat.position));
  splat.position -= shift * aside;
  for (SplatScalar& value : values) {
    const glm::dvec3 gradient = gradientOf(before, value.slope);
    // Towards the point, whose value it has: no value beyond those of the samples around comes out.
    value.mean -= std::max(shift, 0.0) * glm::dot(gradient, aside);
    value.slope = gradient * splat.factor();
  }
}

bool halveSlab(std::span<const OuterPlane> planes, const NodeSplat& whole,
               std::span<const SplatScalar> values, std::array<SlabHalf, 2>& halves) {
  if (planes.size() < 2 || !(whole.splat.weight > 0)) return false;
  const std::optional<glm::dvec3> q =
      acrossLayer(directionsOf(planes, true).all(), whole.splat.position, whole.splat);
  if (!q) return false;
  const glm::dvec3 along = whole.splat.factor() * *q, normal = glm::normalize(gradientOf(whole.splat, *q));
  const glm::dmat3 factor = whole.splat.factor();
  const glm::dmat3 shape = factor * glm::transpose(factor) - 0.75 * glm::outerProduct(along, along);
  for (const int side : {0, 1}) {
    const double to_face = side == 0 ? -1 : 1;
    SlabHalf& half = halves[static_cast<size_t>(side)];
    half.splat = whole;
    Splat& splat = half.splat.splat;
    splat.position += 0.25 * to_face * along;
    splat.weight *= 0.5;
    setShape(splat, {shape[0][0], shape[0][1], shape[1][1], shape[0][2], shape[1][2], shape[2][2]},
             smallestAxis(splat.position));
    half.splat.growth_code = growthCodeOfHalf(whole, splat);
    half.values.assign(values.begin(), values.end());
    for (SplatScalar& value : half.values)
      value.slope = inFrameOf(splat, factor * (value.slope - glm::dot(value.slope, *q) * *q));
    half.planes.clear();
    for (OuterPlane plane : planes) {
      const double faces = to_face * glm::dot(normal, plane.inward) / glm::length(plane.inward);
      if (faces > kSimilar) continue;  // the other half's
      if (faces >= -kSimilar) {        // a side, which both share
        plane.inward *= 0.5;
        plane.point += 0.25 * to_face * along;
      }
      half.planes.push_back(plane);
    }
  }
  return true;
}

uint32_t meshBorderCode(std::span<const OuterPlane> planes, const Splat& splat, double next) {
  if (!(splat.weight > 0)) return kNoBorder;
  const bool touching =
      std::any_of(planes.begin(), planes.end(), [](const OuterPlane& plane) { return plane.touches; });
  VoxelPlanes found = joined(planes, touching);
  for (size_t n = 0; n < found.count; ++n)
    found.planes[n].thickest = 0.5 * next * glm::length(found.planes[n].inward * splat.factor());
  return mergedBorderCode(found, splat.position, splat, 0);
}

}  // namespace curvisplat
