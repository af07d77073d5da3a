#include "preprocess/splats/dual_cell.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/shape/sample_range.h"
#include "preprocess/shape/shape.h"
#include "preprocess/splats/inner_nodes.h"

namespace curvisplat {
namespace {

/// The corners of the octant at a node of a cell, from the node. `corner`: of the cell, from the node, which is number 0.
std::array<glm::dvec3, 8> octantOf(const std::array<glm::dvec3, 8>& corner) {
  const glm::dvec3 ij = corner[1] + corner[2];
  const glm::dvec3& k = corner[4];
  return {glm::dvec3(0.0),
          0.5 * corner[1],
          0.5 * corner[2],
          0.25 * (ij + corner[3]),
          0.5 * k,
          0.25 * ((corner[1] + k) + corner[5]),
          0.25 * ((corner[2] + k) + corner[6]),
          0.125 * (((ij + corner[3]) + (k + corner[5])) + (corner[6] + corner[7]))};
}

/// Adds the moments of a hexahedron, times `sign`, by Gauss's quadrature of three points an axis.
void addMoments(const std::array<glm::dvec3, 8>& corner, double sign, DualPiece& piece) {
  static const double kFar = 0.5 * std::sqrt(0.6);
  const std::array<double, 3> at{0.5 - kFar, 0.5, 0.5 + kFar}, weight{5.0 / 18, 8.0 / 18, 5.0 / 18};
  for (size_t w = 0; w < 3; ++w)
    for (size_t v = 0; v < 3; ++v)
      for (size_t u = 0; u < 3; ++u) {
        glm::dvec3 p(0.0);
        glm::dmat3 jacobian(0.0);
        for (size_t c = 0; c < 8; ++c) {
          const std::array<double, 3> along{(c & 1) != 0 ? at[u] : 1 - at[u],
                                            (c & 2) != 0 ? at[v] : 1 - at[v],
                                            (c & 4) != 0 ? at[w] : 1 - at[w]};
          p += along[0] * along[1] * along[2] * corner[c];
          jacobian[0] += ((c & 1) != 0 ? 1.0 : -1.0) * along[1] * along[2] * corner[c];
          jacobian[1] += ((c & 2) != 0 ? 1.0 : -1.0) * along[0] * along[2] * corner[c];
          jacobian[2] += ((c & 4) != 0 ? 1.0 : -1.0) * along[0] * along[1] * corner[c];
        }
        const double share = sign * weight[u] * weight[v] * weight[w] *
                             Hexahedron::triple(jacobian[0], jacobian[1], jacobian[2]);
        piece.first += share * p;
        const std::array<double, 6> products{p.x * p.x, p.x * p.y, p.y * p.y,
                                             p.x * p.z, p.y * p.z, p.z * p.z};
        for (size_t n = 0; n < products.size(); ++n) piece.second[n] += share * products[n];
      }
}

/// The volume of a whole dual cell where its corrections are small, else 0. inner_nodes.cpp has the same bits.
double gentleVolume(const NodeLattice& nodes, ptrdiff_t at, const std::array<ptrdiff_t, 3>& strides) {
  const glm::dvec3 here = nodes.position(at);
  std::array<glm::dvec3, 3> x, xx, mixed, third;  // mixed[p]: along the other two axes
  for (size_t p = 0; p < 3; ++p) {
    const glm::dvec3 before = nodes.position(at - strides[p]), after = nodes.position(at + strides[p]);
    x[p] = 0.5 * (after - before);
    xx[p] = (after - here) - (here - before);
    third[p] = -4.0 * x[p];
  }
  for (size_t r = 0; r < 3; ++r) {
    const size_t p = (r + 1) % 3, q = (r + 2) % 3;
    const ptrdiff_t sum = strides[p] + strides[q], difference = strides[p] - strides[q];
    const glm::dvec3 a = nodes.position(at + sum) - nodes.position(at - sum),
                     b = nodes.position(at + difference) - nodes.position(at - difference);
    mixed[r] = 0.25 * ((nodes.position(at + sum) + nodes.position(at - sum)) -
                       (nodes.position(at + difference) + nodes.position(at - difference)));
    third[p] += 0.5 * (a + b);
    third[q] += 0.5 * (a - b);
  }
  double volume = 0, correction = 0;
  for (size_t p = 0; p < 3; ++p) {
    const size_t q = (p + 1) % 3, r = (p + 2) % 3;
    const glm::dvec3 area = glm::cross(x[q], x[r]);
    if (p == 0) volume = glm::dot(x[p], area);
    const glm::dvec3 bent =
        (glm::cross(mixed[p], xx[r]) + glm::cross(xx[q], mixed[p])) + 0.5 * glm::cross(mixed[r], mixed[q]);
    correction += glm::dot(third[p], area) + glm::dot(x[p], bent);
  }
  correction *= 0.125;
  return std::abs(correction) <= kMaxCorrection * std::abs(volume) ? volume + correction : 0.0;
}

/// Whether the sides of the cells at the node that lie across an axis of the lattice have any area.
bool hasFace(const CollapsedNode& node, size_t axis) {
  constexpr double kFlat = 1e-9;
  const ptrdiff_t q = node.strides[(axis + 1) % 3], r = node.strides[(axis + 2) % 3];
  for (uint32_t cell = 0; cell < kCellsAround; ++cell) {
    if ((node.there >> cell & 1) == 0) continue;
    const ptrdiff_t along_q = (cell >> (axis + 1) % 3 & 1) != 0 ? q : -q,
                    along_r = (cell >> (axis + 2) % 3 & 1) != 0 ? r : -r;
    const glm::dvec3 one = node.nodes.position(node.at + along_q + along_r) - node.nodes.position(node.at),
                     other = node.nodes.position(node.at + along_q) - node.nodes.position(node.at + along_r);
    if (glm::length(glm::cross(one, other)) > kFlat * (glm::dot(one, one) + glm::dot(other, other)))
      return true;
  }
  return false;
}

}  // namespace

uint32_t cellsAround(const NodeLattice& nodes, ptrdiff_t at, const std::array<ptrdiff_t, 3>& strides,
                     const std::array<uint64_t, 3>& index, const std::array<uint64_t, 3>& count) {
  uint32_t there = 0;
  for (uint32_t cell = 0; cell < kCellsAround; ++cell) {
    bool is_there = true;
    std::array<ptrdiff_t, 3> step{};
    for (size_t axis = 0; axis < 3; ++axis) {
      const bool is_above = (cell >> axis & 1) != 0;
      is_there &= is_above ? index[axis] + 1 < count[axis] : index[axis] > 0;
      step[axis] = is_above ? strides[axis] : -strides[axis];
    }
    for (uint32_t corner = 1; is_there && corner < kCellsAround; ++corner) {
      ptrdiff_t n = at;
      for (size_t axis = 0; axis < 3; ++axis)
        if ((corner >> axis & 1) != 0) n += step[axis];
      is_there = !nodes.blank[n];
    }
    if (is_there) there |= 1u << cell;
  }
  return there;
}

DualPiece dualPiece(const NodeLattice& nodes, ptrdiff_t at, const std::array<ptrdiff_t, 3>& strides,
                    uint32_t there, bool moments) {
  const glm::dvec3 here = nodes.position(at);
  DualPiece piece;
  for (uint32_t cell = 0; cell < kCellsAround; ++cell) {
    if ((there >> cell & 1) == 0) continue;
    std::array<glm::dvec3, 8> corner;
    double sign = 1;
    for (uint32_t axis = 0; axis < 3; ++axis)
      if ((cell >> axis & 1) == 0) sign = -sign;
    for (uint32_t c = 0; c < corner.size(); ++c) {
      ptrdiff_t n = at;
      for (uint32_t axis = 0; axis < 3; ++axis)
        if ((c >> axis & 1) != 0) n += (cell >> axis & 1) != 0 ? strides[axis] : -strides[axis];
      corner[c] = nodes.position(n) - here;
    }
    const std::array<glm::dvec3, 8> octant = octantOf(corner);
    piece.volume += sign * Hexahedron(octant).volume();
    if (moments) addMoments(octant, sign, piece);
  }
  return piece;
}

double dualVolume(const NodeLattice& nodes, ptrdiff_t at, const std::array<ptrdiff_t, 3>& strides,
                  uint32_t there) {
  const double gentle = there == kAllCellsAround ? gentleVolume(nodes, at, strides) : 0.0;
  return std::abs(gentle != 0 ? gentle : dualPiece(nodes, at, strides, there, false).volume);
}

std::array<double, 3> widthGrowth(const NodeLattice& nodes, ptrdiff_t at, const Neighbours& neighbours) {
  std::array<glm::dvec3, 3> x, mixed, area;
  for (size_t p = 0; p < 3; ++p)
    x[p] = 0.5 * (nodes.position(at + neighbours.after[p]) - nodes.position(at + neighbours.before[p]));
  for (size_t r = 0; r < 3; ++r) {
    const size_t p = (r + 1) % 3, q = (r + 2) % 3;
    const ptrdiff_t after = at + neighbours.after[p] + neighbours.after[q],
                    before = at + neighbours.before[p] + neighbours.before[q],
                    aside = at + neighbours.after[p] + neighbours.before[q],
                    other = at + neighbours.before[p] + neighbours.after[q];
    mixed[r] = 0.25 * ((nodes.position(after) + nodes.position(before)) -
                       (nodes.position(aside) + nodes.position(other)));
    if (nodes.blank[after] || nodes.blank[before] || nodes.blank[aside] || nodes.blank[other])
      mixed[r] = glm::dvec3(0.0);
    area[r] = glm::cross(x[p], x[q]);
  }
  const double volume = glm::dot(x[0], area[0]);
  std::array<double, 3> growth{};
  if (volume == 0) return growth;
  for (size_t r = 0; r < 3; ++r) {
    const size_t p = (r + 1) % 3, q = (r + 2) % 3;
    growth[p] += glm::dot(area[q], mixed[r]);
    growth[q] += glm::dot(area[p], mixed[r]);
  }
  for (double& of_axis : growth) of_axis = std::min(std::max(of_axis / volume, -1.0), 1.0);
  return growth;
}

std::optional<PieceSplat> splatOfPiece(const CollapsedNode& node, std::span<const float* const> scalars,
                                       std::span<SplatScalar> values) {
  // Nodes that all coincide have no volume: their moments, which take far longer, are not needed.
  if (!(std::abs(dualPiece(node.nodes, node.at, node.strides, node.there, false).volume) > 0))
    return std::nullopt;
  const DualPiece piece = dualPiece(node.nodes, node.at, node.strides, node.there, true);
  PieceSplat out;
  const glm::dvec3 middle = piece.first / piece.volume;
  // Cells of opposite handedness cancel each other, as where latitudes go on beyond a pole: the rest is no piece.
  double reach = 0;
  for (size_t axis = 0; axis < 3; ++axis)
    reach += std::max(glm::distance(node.nodes.position(node.at),
                                    node.nodes.position(node.at + node.neighbours.after[axis])),
                      glm::distance(node.nodes.position(node.at),
                                    node.nodes.position(node.at + node.neighbours.before[axis])));
  if (!(glm::length(middle) <= reach)) return std::nullopt;
  const auto spread = [&](size_t n, double product) {
    return 12 * (piece.second[n] / piece.volume - product);
  };
  setShape(out.splat,
           {spread(0, middle.x * middle.x), spread(1, middle.x * middle.y), spread(2, middle.y * middle.y),
            spread(3, middle.x * middle.z), spread(4, middle.y * middle.z), spread(5, middle.z * middle.z)},
           node.smallest);
  out.splat.position = node.nodes.position(node.at) + middle;
  out.splat.weight = std::abs(piece.volume);

  glm::dmat3 steps;
  for (size_t axis = 0; axis < 3; ++axis)
    steps[static_cast<int>(axis)] = 0.5 * (node.nodes.position(node.at + node.neighbours.after[axis]) -
                                           node.nodes.position(node.at + node.neighbours.before[axis]));
  // Nodes at a pole that differ by rounding alone have no direction from one to the other.
  double longest = 0;
  for (int axis = 0; axis < 3; ++axis) longest = std::max(longest, glm::length(steps[axis]));
  for (int axis = 0; axis < 3; ++axis)
    if (!(glm::length(steps[axis]) > kCollapsed * longest)) steps[axis] = glm::dvec3(0.0);
  std::array<glm::dvec3, 3> ends{};
  size_t count = 0;
  for (size_t axis = 0; axis < 3; ++axis) {
    if (node.inwards[axis] == 0 || !hasFace(node, axis)) continue;
    glm::dvec3 inward = node.inwards[axis] * inFrameOf(out.splat, steps[static_cast<int>(axis)]);
    for (size_t n = 0; n < count; ++n) inward -= glm::dot(inward, ends[n]) * ends[n];
    if (glm::length(inward) > 0) ends[count++] = glm::normalize(inward);
  }
  out.border_code = count > 0 ? packBorderCode({ends.data(), count}, (1u << count) - 1) : kNoBorder;

  const LatticeGradient gradient_of(steps);
  const glm::dmat3 factor = out.splat.factor();
  for (size_t v = 0; v < scalars.size(); ++v) {
    const float* const f = scalars[v];
    SampleRange range(f[node.at]);
    glm::dvec3 differences;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double before = f[node.at + node.neighbours.before[axis]],
                   after = f[node.at + node.neighbours.after[axis]];
      differences[static_cast<int>(axis)] = 0.5 * (after - before);
      range.add(before);
      range.add(after);
    }
    const glm::dvec3 gradient = gradient_of(differences);
    values[v] = range.bounded({f[node.at] + glm::dot(gradient, middle), gradient * factor, 0.0});
  }
  return out;
}

}  // namespace curvisplat
