// The volumes of the parts of curved cells, against closed forms.
#include "preprocess/mesh/curved_cells.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/mesh/bezier_cells.h"
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
  volumesOf(CellKind::kHexahedron, kCurve)->measure(nodes, {}, volumes);
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

TEST(CurvedCells, PolyhedraWithoutAFaceAreOpen) {
  const auto faces = facesOf(CellKind::kHexahedron, {});
  EXPECT_TRUE(isClosed(faces));
  EXPECT_FALSE(isClosed(faces.subspan(5)));
  const std::vector<uint32_t> doubled{3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2};
  EXPECT_FALSE(isClosed(doubled));
  EXPECT_TRUE(isClosed({}));
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
    volumesOf(c.shape, c.curve)->measure(nodes, {}, volumes);
    EXPECT_NEAR(std::accumulate(volumes.begin(), volumes.end(), 0.0), exactVolume(c.shape), 1e-12)
        << static_cast<int>(c.shape) << " of order " << static_cast<int>(c.curve.order);
  }
}

TEST(CurvedCells, OrdersAlongTheAxesMayDiffer) {
  constexpr CellCurve kCurve{3, 4, true, 2};
  std::vector<glm::dvec3> nodes;
  for (const auto& [i, j, k] : nodesOf(CellKind::kHexahedron, kCurve))
    nodes.push_back(bent({i / 3.0, j / 2.0, k / 4.0}));
  ASSERT_EQ(nodes.size(), 60u);
  std::vector<double> volumes(partsOf(CellKind::kHexahedron, kCurve).size());
  EXPECT_EQ(volumes.size(), 24u);
  volumesOf(CellKind::kHexahedron, kCurve)->measure(nodes, {}, volumes);
  EXPECT_NEAR(std::accumulate(volumes.begin(), volumes.end(), 0.0), exactVolume(CellKind::kHexahedron),
              1e-12);
}

TEST(CurvedCells, BezierCellsHaveTheirPolynomialAtTheNodes) {
  for (const auto& [shape, curve] :
       {std::pair(CellKind::kTetrahedron, CellCurve{4, 4}), std::pair(CellKind::kWedge, CellCurve{3, 5}),
        std::pair(CellKind::kHexahedron, CellCurve{2, 4, true, 3}),
        std::pair(CellKind::kHexahedron, CellCurve{10, 10})}) {
    // The control values of x squared, and of x and z, which are the places of the control points.
    const double n = curve.order, m = curve.layers;
    std::vector<double> values;
    const auto places = nodesOf(shape, curve);
    for (const auto& [i, j, k] : places)
      for (const double value : {i * (i - 1) / (n * (n - 1)), i / n, k / m}) values.push_back(value);
    bezierOf(shape, curve).evaluate(values, 3);
    for (size_t node = 0; node < places.size(); ++node) {
      const double x = places[node][0] / n;
      EXPECT_NEAR(values[3 * node], x * x, 1e-13);
      EXPECT_NEAR(values[3 * node + 1], x, 1e-13);
      EXPECT_NEAR(values[3 * node + 2], places[node][2] / m, 1e-13);
    }
  }
}

/// The volume of a rational Bezier cell over its exact one.
double shareOfVolume(CellKind shape, CellCurve curve, std::span<const glm::dvec4> controls, double exact) {
  std::vector<double> values;
  for (const glm::dvec4& control : controls)
    for (int c = 0; c < 4; ++c) values.push_back(c < 3 ? control[c] * control.w : control.w);
  bezierOf(shape, curve).evaluate(values, 4);
  std::vector<glm::dvec3> nodes;
  std::vector<double> weights;
  for (size_t n = 0; n < values.size(); n += 4) {
    nodes.push_back(glm::dvec3(values[n], values[n + 1], values[n + 2]) / values[n + 3]);
    weights.push_back(values[n + 3]);
  }
  std::vector<double> volumes(partsOf(shape, curve).size());
  volumesOf(shape, curve, true)->measure(nodes, weights, volumes);
  return std::accumulate(volumes.begin(), volumes.end(), 0.0) / exact;
}

TEST(CurvedCells, PartsOfRationalCellsHaveTheVolumesOfCircles) {
  constexpr double kWeight = std::numbers::sqrt2 / 2;
  // A quarter of a ring between the radii 1 and 2, of height 3: the middle control points are where tangents meet.
  constexpr CellCurve kRing{2, 1, true, 1};
  std::vector<glm::dvec4> ring;
  for (const auto& [i, j, k] : nodesOf(CellKind::kHexahedron, kRing))
    ring.emplace_back((1.0 + j) * (i < 2), (1.0 + j) * (i > 0), 3.0 * k, i == 1 ? kWeight : 1);
  EXPECT_NEAR(shareOfVolume(CellKind::kHexahedron, kRing, ring, std::numbers::pi / 4 * (4 - 1) * 3), 1, 1e-6);
  // A quarter of a disc of radius 2 and height 1.
  constexpr CellCurve kSector{2, 1};
  std::vector<glm::dvec4> sector;
  for (const auto& [i, j, k] : nodesOf(CellKind::kWedge, kSector)) {
    const bool tangents = i == 1 && j == 1;
    sector.emplace_back(tangents ? 2 : i, tangents ? 2 : j, k, tangents ? kWeight : 1);
  }
  EXPECT_NEAR(shareOfVolume(CellKind::kWedge, kSector, sector, std::numbers::pi), 1, 1e-6);
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
