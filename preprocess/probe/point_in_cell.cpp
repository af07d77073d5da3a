#include "preprocess/probe/point_in_cell.h"

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "preprocess/grid/hexahedron.h"

namespace curvisplat {
namespace {

// The tolerance for a point outside of a cell that has it, in the cell's own coordinates.
constexpr double kOutside = 1e-6;

using Tetrahedron = std::array<glm::dvec3, 4>;

std::optional<std::array<double, 4>> weightsInTetrahedron(const Tetrahedron& corners,
                                                          const glm::dvec3& point) {
  const glm::dmat3 edges(corners[1] - corners[0], corners[2] - corners[0], corners[3] - corners[0]);
  if (glm::determinant(edges) == 0) return std::nullopt;
  const glm::dvec3 w = glm::inverse(edges) * (point - corners[0]);
  const std::array<double, 4> weights{1 - w.x - w.y - w.z, w.x, w.y, w.z};
  for (const double weight : weights)
    if (!(weight >= -kOutside)) return std::nullopt;
  return weights;
}

/// Each corner of a hexahedron, numbered by its bits along the axes, is this corner of the cell.
constexpr std::array<size_t, 8> kOfHexahedron{0, 1, 3, 2, 4, 5, 7, 6}, kOfWedge{0, 1, 2, 2, 3, 4, 5, 5},
    kOfPyramid{0, 1, 3, 2, 4, 4, 4, 4};

std::optional<std::vector<double>> weightsAsHexahedron(std::span<const glm::dvec3> corners,
                                                       const std::array<size_t, 8>& places,
                                                       const glm::dvec3& point) {
  std::array<glm::dvec3, 8> of_hexahedron;
  for (size_t c = 0; c < 8; ++c) of_hexahedron[c] = corners[places[c]];
  const auto found = weightsInHexahedron(of_hexahedron, point);
  if (!found) return std::nullopt;
  std::vector<double> weights(corners.size());
  for (size_t c = 0; c < 8; ++c) weights[places[c]] += (*found)[c];
  return weights;
}

std::optional<std::vector<double>> weightsInPolyhedron(std::span<const glm::dvec3> corners,
                                                       std::span<const uint32_t> faces,
                                                       const glm::dvec3& point) {
  glm::dvec3 centre(0.0);
  for (const glm::dvec3& corner : corners) centre += corner / static_cast<double>(corners.size());
  for (size_t at = 0; at < faces.size();) {
    const std::span<const uint32_t> face = faces.subspan(at + 1, faces[at]);
    at += 1 + face.size();
    const double share = 1.0 / static_cast<double>(face.size());
    glm::dvec3 middle(0.0);
    for (const uint32_t place : face) middle += share * corners[place];
    for (size_t n = 0; n < face.size(); ++n) {
      const uint32_t a = face[n], b = face[(n + 1) % face.size()];
      const auto found = weightsInTetrahedron({centre, middle, corners[a], corners[b]}, point);
      if (!found) continue;
      std::vector<double> weights(corners.size(), (*found)[0] / static_cast<double>(corners.size()));
      for (const uint32_t place : face) weights[place] += share * (*found)[1];
      weights[a] += (*found)[2];
      weights[b] += (*found)[3];
      return weights;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::array<double, 8>> weightsInHexahedron(const std::array<glm::dvec3, 8>& corners,
                                                         const glm::dvec3& point) {
  glm::dvec3 lower = corners[0], upper = corners[0];
  for (const glm::dvec3& corner : corners) lower = glm::min(lower, corner), upper = glm::max(upper, corner);
  const glm::dvec3 slack = kOutside * (upper - lower);
  for (int axis = 0; axis < 3; ++axis)
    if (!(point[axis] >= lower[axis] - slack[axis] && point[axis] <= upper[axis] + slack[axis]))
      return std::nullopt;
  const auto u = locateInHexahedron(corners, point);
  if (!u) return std::nullopt;
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::abs((*u)[axis]) <= 1 + 2 * kOutside)) return std::nullopt;
  std::array<double, 8> weights;
  for (size_t c = 0; c < 8; ++c) {
    const glm::dvec3 side(c & 1 ? 1 : -1, c & 2 ? 1 : -1, c & 4 ? 1 : -1);
    const glm::dvec3 along = 0.5 * (1.0 + side * *u);
    weights[c] = along.x * along.y * along.z;
  }
  return weights;
}

std::optional<std::vector<double>> weightsInCell(CellKind shape, std::span<const glm::dvec3> corners,
                                                 std::span<const uint32_t> faces, const glm::dvec3& point) {
  switch (shape) {
    case CellKind::kTetrahedron: {
      const auto found = weightsInTetrahedron({corners[0], corners[1], corners[2], corners[3]}, point);
      return found ? std::optional(std::vector<double>(found->begin(), found->end())) : std::nullopt;
    }
    case CellKind::kHexahedron:
      return weightsAsHexahedron(corners, kOfHexahedron, point);
    case CellKind::kWedge:
      return weightsAsHexahedron(corners, kOfWedge, point);
    case CellKind::kPyramid:
      return weightsAsHexahedron(corners, kOfPyramid, point);
    case CellKind::kPolyhedron:
      return weightsInPolyhedron(corners, faces, point);
    case CellKind::kNone:
      break;
  }
  return std::nullopt;
}

}  // namespace curvisplat
