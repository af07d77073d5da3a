// The volumes of the parts of curved cells, against closed forms.
#include "preprocess/mesh/curved_cells.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>
#include <vector>

#include "preprocess/mesh/curved_volumes.h"

namespace curvisplat {
namespace {

TEST(CurvedCells, PartsOfAShellOfOneLayerHaveItsVolume) {
  // A quarter of a face of a cube, bent to a sphere, from radius 1 to 2.
  constexpr CellCurve kCurve{7, 7};
  std::vector<glm::dvec3> nodes;
  for (const auto& [i, j, k] : nodesOf(CellKind::kHexahedron, kCurve)) {
    const auto slope = [](double n) { return std::tan(std::numbers::pi / 4 * n / 7); };
    nodes.push_back(glm::normalize(glm::dvec3(1, slope(i), slope(j))) * (1 + k / 7.0));
  }
  const CellParts& parts = partsOf(CellKind::kHexahedron, kCurve);
  ASSERT_EQ(parts.size(), 343u);
  std::vector<double> volumes(parts.size());
  volumesOf(CellKind::kHexahedron, kCurve)->measure(nodes, volumes);
  const double exact = 4 * std::numbers::pi / 3 * (8 - 1) / 24;
  EXPECT_NEAR(std::accumulate(volumes.begin(), volumes.end(), 0.0) / exact, 1, 1e-6);
}

/// A map of degree two, whose Jacobian is 1 + x / 2 + y / 5: of the corner (0, 0, 0) of the lattice.
glm::dvec3 bent(const glm::dvec3& at) {
  return {at.x + at.x * at.x / 4 + at.x * at.y / 5, at.y + 0.1 * at.z * at.z, at.z};
}

/// The integral of its Jacobian over the cell of unit size: the volume, and the means of x and y.
double exactVolume(CellKind shape) {
  const auto of = [](double volume, double mean) { return volume * (1 + mean / 2 + mean / 5); };
  if (shape == CellKind::kTetrahedron) return of(1.0 / 6, 0.25);
  if (shape == CellKind::kWedge) return of(1.0 / 2, 1.0 / 3);
  return of(1, 0.5);
}

TEST(CurvedCells, PartsOfBentCellsHaveTheirVolumes) {
  struct Case {
    CellKind shape;
    CellCurve curve;
    size_t parts;
  };
  for (const Case& c :
       {Case{CellKind::kTetrahedron, {2, 2}, 8}, Case{CellKind::kTetrahedron, {5, 5}, 125},
        Case{CellKind::kWedge, {2, 2}, 8}, Case{CellKind::kWedge, {2, 2, false}, 7},
        Case{CellKind::kWedge, {4, 4}, 64}, Case{CellKind::kHexahedron, {2, 2}, 8},
        Case{CellKind::kHexahedron, {2, 2, false}, 9}, Case{CellKind::kHexahedron, {6, 6}, 216}}) {
    std::vector<glm::dvec3> nodes;
    for (const auto& [i, j, k] : nodesOf(c.shape, c.curve))
      nodes.push_back(bent(glm::dvec3(i, j, k) / static_cast<double>(c.curve.order)));
    const CellParts& parts = partsOf(c.shape, c.curve);
    EXPECT_EQ(parts.size(), c.parts);
    std::vector<double> volumes(parts.size());
    volumesOf(c.shape, c.curve)->measure(nodes, volumes);
    EXPECT_NEAR(std::accumulate(volumes.begin(), volumes.end(), 0.0), exactVolume(c.shape), 1e-12)
        << static_cast<int>(c.shape) << " of order " << static_cast<int>(c.curve.order);
  }
}

TEST(CurvedCells, OrdersOfExodusAndCgnsBecomeThatOfVtk) {
  using Places = std::vector<std::array<uint8_t, 3>>;
  // Corners, edges below, of the sides and above; then the middle and the faces, or the faces and the middle.
  const Places edges{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {2, 2, 2},
                     {0, 2, 2}, {1, 0, 0}, {2, 1, 0}, {1, 2, 0}, {0, 1, 0}, {0, 0, 1}, {2, 0, 1},
                     {2, 2, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 2}, {1, 2, 2}, {0, 1, 2}};
  Places exodus = edges, cgns = edges;
  for (const auto& place :
       Places{{1, 1, 1}, {1, 1, 0}, {1, 1, 2}, {0, 1, 1}, {2, 1, 1}, {1, 0, 1}, {1, 2, 1}})
    exodus.push_back(place);
  for (const auto& place :
       Places{{1, 1, 0}, {1, 0, 1}, {2, 1, 1}, {1, 2, 1}, {0, 1, 1}, {1, 1, 2}, {1, 1, 1}})
    cgns.push_back(place);
  const Places wedge{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {0, 2, 2}, {1, 0, 0}, {1, 1, 0},
                     {0, 1, 0}, {0, 0, 1}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {1, 1, 2}, {0, 1, 2}};
  const auto check = [](CellKind shape, bool is_cgns, const Places& places) {
    std::vector<uint64_t> nodes(places.size());
    std::iota(nodes.begin(), nodes.end(), uint64_t{0});
    MeshCells cells;
    appendCurvedAsExodus(shape, is_cgns, nodes, cells);
    ASSERT_EQ(cells.curved.size(), 1u);
    const Places expected = nodesOf(shape, cells.curved[0].second);
    ASSERT_EQ(expected.size(), places.size());
    for (size_t n = 0; n < places.size(); ++n) EXPECT_EQ(places[cells.cornersOfCell(0)[n]], expected[n]) << n;
  };
  check(CellKind::kHexahedron, false, exodus);
  check(CellKind::kHexahedron, true, cgns);
  check(CellKind::kHexahedron, false, edges);
  check(CellKind::kWedge, true, wedge);
}

}  // namespace
}  // namespace curvisplat
