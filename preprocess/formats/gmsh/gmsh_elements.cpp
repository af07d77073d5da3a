#include "preprocess/formats/gmsh/gmsh_elements.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <utility>

#include "preprocess/mesh/curved_cells.h"

namespace curvisplat {
namespace {

using LatticePoint = std::array<int, 3>;
using LatticePoints = std::vector<LatticePoint>;

/// A shape whose nodes Gmsh lists by corners, edges, faces, and the same shape inside, of an order that is less by `shrinks`.
/// Source: Gmsh's reference manual, "Node ordering", and elements of orders 2 to 7 of Gmsh 4.8.
struct GmshShape {
  std::vector<std::pair<size_t, size_t>> edges;
  std::vector<std::vector<size_t>> faces;
  int shrinks = 0;
};

const GmshShape& shapeOfFace(size_t corners) {
  static const GmshShape triangle{{{0, 1}, {1, 2}, {2, 0}}, {}, 3};
  static const GmshShape quad{{{0, 1}, {1, 2}, {2, 3}, {3, 0}}, {}, 2};
  return corners == 3 ? triangle : quad;
}

const GmshShape& shapeOf(CellKind kind) {
  static const GmshShape tetrahedron{
      {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {3, 2}, {3, 1}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {3, 1, 2}}, 4};
  static const GmshShape hexahedron{
      {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}},
      {{0, 3, 2, 1}, {0, 1, 5, 4}, {0, 4, 7, 3}, {1, 2, 6, 5}, {2, 3, 7, 6}, {4, 5, 6, 7}},
      2};
  static const GmshShape wedge{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 4}, {2, 5}, {3, 4}, {3, 5}, {4, 5}},
                               {{0, 2, 1}, {3, 4, 5}, {0, 1, 4, 3}, {0, 3, 5, 2}, {1, 2, 5, 4}}};
  static const GmshShape pyramid{{{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 4}, {2, 3}, {2, 4}, {3, 4}},
                                 {{0, 1, 4}, {3, 0, 4}, {1, 2, 4}, {2, 3, 4}, {0, 3, 2, 1}},
                                 3};
  if (kind == CellKind::kTetrahedron) return tetrahedron;
  if (kind == CellKind::kHexahedron) return hexahedron;
  return kind == CellKind::kWedge ? wedge : pyramid;
}

/// The corners of the shape inside: each is moved by one node along each of its edges, but a pyramid's apex, where four meet.
LatticePoints inside(const LatticePoints& corners, const GmshShape& shape, int order) {
  LatticePoints moved = corners;
  for (const auto& [a, b] : shape.edges)
    for (size_t axis = 0; axis < 3; ++axis) {
      const int step = (corners[b][axis] - corners[a][axis]) / order;
      moved[a][axis] += step;
      moved[b][axis] -= step;
    }
  constexpr size_t kApex = 4;
  if (corners.size() == kApex + 1)
    moved[kApex] = {corners[kApex][0] + 1, corners[kApex][1] + 1, corners[kApex][2] - 2};
  return moved;
}

void addNodes(const GmshShape& shape, const LatticePoints& corners, int order, LatticePoints& out) {
  if (order < 0) return;
  if (order == 0) return out.push_back(corners[0]);
  out.insert(out.end(), corners.begin(), corners.end());
  for (const auto& [a, b] : shape.edges)
    for (int n = 1; n < order; ++n) {
      LatticePoint& node = out.emplace_back(corners[a]);
      for (size_t axis = 0; axis < 3; ++axis) node[axis] += (corners[b][axis] - corners[a][axis]) / order * n;
    }
  for (const std::vector<size_t>& face : shape.faces) {
    LatticePoints of_face;
    for (const size_t corner : face) of_face.push_back(corners[corner]);
    const GmshShape& flat = shapeOfFace(face.size());
    addNodes(flat, inside(of_face, flat, order), order - flat.shrinks, out);
  }
  if (shape.shrinks > 0) addNodes(shape, inside(corners, shape, order), order - shape.shrinks, out);
}

/// The nodes inside a wedge: above each inside its triangle the lowest, the highest, and those between.
void addNodesInWedge(const LatticePoints& corners, int order, LatticePoints& out) {
  const GmshShape& flat = shapeOfFace(3);
  LatticePoints triangle;
  addNodes(flat, inside({corners.begin(), corners.begin() + 3}, flat, order), order - 3, triangle);
  for (LatticePoint node : triangle) {
    const auto add = [&](int layer) {
      node[2] = layer;
      out.push_back(node);
    };
    add(1);
    add(order - 1);
    for (int layer = 2; layer < order - 1; ++layer) add(layer);
  }
}

LatticePoints cornersOfOrder(CellKind kind, int n) {
  if (kind == CellKind::kTetrahedron) return {{0, 0, 0}, {n, 0, 0}, {0, n, 0}, {0, 0, n}};
  if (kind == CellKind::kPyramid) return {{0, 0, 0}, {n, 0, 0}, {n, n, 0}, {0, n, 0}, {0, 0, n}};
  if (kind == CellKind::kWedge) return {{0, 0, 0}, {n, 0, 0}, {0, n, 0}, {0, 0, n}, {n, 0, n}, {0, n, n}};
  return {{0, 0, 0}, {n, 0, 0}, {n, n, 0}, {0, n, 0}, {0, 0, n}, {n, 0, n}, {n, n, n}, {0, n, n}};
}

std::vector<uint16_t> orderOf(CellKind kind, size_t nodes) {
  const CellCurve curve = nodes > cornersOf(kind) ? curveOf(kind, nodes) : CellCurve{};
  if (curve.order == 0) return {};
  LatticePoints of_gmsh;
  const LatticePoints corners = cornersOfOrder(kind, curve.order);
  addNodes(shapeOf(kind), corners, curve.order, of_gmsh);
  if (kind == CellKind::kWedge) addNodesInWedge(corners, curve.order, of_gmsh);
  std::map<LatticePoint, uint16_t> number;
  for (size_t n = 0; n < nodes; ++n) number.emplace(of_gmsh[n], static_cast<uint16_t>(n));
  std::vector<uint16_t> order;
  for (const auto& node : nodesOf(kind, curve)) order.push_back(number.at({node[0], node[1], node[2]}));
  return order;
}

/// Adds types of the orders from `order` on, with as many nodes as nodesOfOrder(order).
template <typename NodesOfOrder>
void addTypes(std::map<int, GmshElement>& elements, CellKind kind, size_t order, std::vector<int> types,
              const NodesOfOrder& nodesOfOrder) {
  for (const int type : types) {
    const size_t nodes = nodesOfOrder(order++);
    elements[type] = {nodes, kind, kind == CellKind::kNone ? std::vector<uint16_t>{} : orderOf(kind, nodes)};
  }
}

std::map<int, GmshElement> allElements() {
  std::map<int, GmshElement> all;
  constexpr CellKind kFlat = CellKind::kNone;
  const auto alongEdges = [](size_t corners, size_t edges) {
    return [=](size_t n) { return corners + edges * (n - 1); };
  };
  addTypes(all, kFlat, 1, {15}, [](size_t) { return 1; });
  addTypes(all, kFlat, 1, {1, 8, 26, 27, 28, 62, 63, 64, 65, 66}, alongEdges(2, 1));
  addTypes(all, kFlat, 1, {2, 9, 21, 23, 25, 42, 43, 44, 45, 46},
           [](size_t n) { return (n + 1) * (n + 2) / 2; });
  addTypes(all, kFlat, 3, {20, 22, 24, 52, 53, 54, 55, 56}, alongEdges(3, 3));
  addTypes(all, kFlat, 1, {3, 10, 36, 37, 38, 47, 48, 49, 50, 51},
           [](size_t n) { return (n + 1) * (n + 1); });
  addTypes(all, kFlat, 2, {16, 39, 40, 41, 57, 58, 59, 60, 61}, alongEdges(4, 4));
  addTypes(all, CellKind::kTetrahedron, 1, {4, 11, 29, 30, 31, 71, 72, 73, 74, 75},
           [](size_t n) { return (n + 1) * (n + 2) * (n + 3) / 6; });
  addTypes(all, CellKind::kTetrahedron, 3, {137, 32, 33, 79, 80, 81, 82, 83}, alongEdges(4, 6));
  addTypes(all, CellKind::kHexahedron, 1, {5, 12, 92, 93, 94, 95, 96, 97, 98},
           [](size_t n) { return (n + 1) * (n + 1) * (n + 1); });
  addTypes(all, CellKind::kHexahedron, 2, {17, 99, 100, 101, 102, 103, 104, 105}, alongEdges(8, 12));
  addTypes(all, CellKind::kWedge, 1, {6, 13, 90, 91, 106, 107, 108, 109, 110},
           [](size_t n) { return (n + 1) * (n + 1) * (n + 2) / 2; });
  addTypes(all, CellKind::kWedge, 2, {18, 111, 112, 113, 114, 115, 116, 117}, alongEdges(6, 9));
  addTypes(all, CellKind::kPyramid, 1, {7, 14, 118, 119, 120, 121, 122, 123, 124},
           [](size_t n) { return (n + 1) * (n + 2) * (2 * n + 3) / 6; });
  addTypes(all, CellKind::kPyramid, 2, {19, 125, 126, 127, 128, 129, 130, 131}, alongEdges(5, 8));
  return all;
}

}  // namespace

const GmshElement* gmshElement(int type) {
  static const std::map<int, GmshElement> all = allElements();
  const auto found = all.find(type);
  return found == all.end() ? nullptr : &found->second;
}

}  // namespace curvisplat
