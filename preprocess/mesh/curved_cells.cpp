#include "preprocess/mesh/curved_cells.h"

#include <algorithm>
#include <map>
#include <memory>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/mutex.h"

namespace curvisplat {
namespace {

using Place = std::array<uint8_t, 3>;
using Edge = std::array<size_t, 2>;

/// Edges in VTK's order, by corners; nodes on them go from the first to the second.
std::span<const Edge> edgesOf(CellKind shape) {
  static constexpr Edge kTetrahedron[] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
  static constexpr Edge kPyramid[] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 4}, {2, 4}, {3, 4}};
  static constexpr Edge kWedge[] = {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}};
  static constexpr Edge kHexahedron[] = {{0, 1}, {1, 2}, {3, 2}, {0, 3}, {4, 5}, {5, 6},
                                         {7, 6}, {4, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
  if (shape == CellKind::kTetrahedron) return kTetrahedron;
  if (shape == CellKind::kPyramid) return kPyramid;
  if (shape == CellKind::kWedge) return kWedge;
  return kHexahedron;
}

std::vector<Place> cornersAt(CellKind shape, CellCurve curve) {
  const uint8_t n = curve.order, m = curve.layers, r = ordersOf(curve)[1];
  if (shape == CellKind::kTetrahedron) return {{0, 0, 0}, {n, 0, 0}, {0, n, 0}, {0, 0, n}};
  if (shape == CellKind::kPyramid) return {{0, 0, 0}, {n, 0, 0}, {n, n, 0}, {0, n, 0}, {0, 0, n}};
  if (shape == CellKind::kWedge) return {{0, 0, 0}, {n, 0, 0}, {0, n, 0}, {0, 0, m}, {n, 0, m}, {0, n, m}};
  return {{0, 0, 0}, {n, 0, 0}, {n, r, 0}, {0, r, 0}, {0, 0, m}, {n, 0, m}, {n, r, m}, {0, r, m}};
}

/// (a * (parts - n) + b * n) / parts.
Place between(const Place& a, const Place& b, int n, int parts) {
  Place place;
  for (size_t axis = 0; axis < 3; ++axis)
    place[axis] = static_cast<uint8_t>((a[axis] * (parts - n) + b[axis] * n) / parts);
  return place;
}

/// The nodes between the ends of an edge. Edges of a pyramid to its apex have i and j of 0 to the order less k.
void addLine(const Place& from, const Place& to, std::vector<Place>& out) {
  int parts = 0;
  for (size_t axis = 0; axis < 3; ++axis) parts = std::max(parts, std::abs(to[axis] - from[axis]));
  for (int n = 1; n < parts; ++n) out.push_back(between(from, to, n, parts));
}

/// Corner `n` of a simplex of an order, moved inside by one node from each face.
template <size_t kCorners>
std::array<Place, kCorners> inside(const std::array<Place, kCorners>& at, int order) {
  std::array<Place, kCorners> moved = at;
  for (size_t n = 0; n < kCorners; ++n)
    for (size_t other = 0; other < kCorners; ++other)
      for (size_t axis = 0; axis < 3; ++axis)
        moved[n][axis] = static_cast<uint8_t>(moved[n][axis] + (at[other][axis] - at[n][axis]) / order);
  return moved;
}

/// The nodes of a triangle: corners, edges, then the triangle inside.
void addTriangle(const std::array<Place, 3>& at, int order, std::vector<Place>& out) {
  if (order == 0) return out.push_back(at[0]);
  out.insert(out.end(), at.begin(), at.end());
  for (size_t n = 0; n < 3; ++n) addLine(at[n], at[(n + 1) % 3], out);
  if (order >= 3) addTriangle(inside(at, order), order - 3, out);
}

void addTetrahedron(const std::array<Place, 4>& at, int order, std::vector<Place>& out) {
  if (order == 0) return out.push_back(at[0]);
  out.insert(out.end(), at.begin(), at.end());
  for (const Edge& edge : edgesOf(CellKind::kTetrahedron)) addLine(at[edge[0]], at[edge[1]], out);
  constexpr std::array<std::array<size_t, 3>, 4> kFaces{{{0, 1, 3}, {2, 3, 1}, {0, 3, 2}, {0, 2, 1}}};
  if (order >= 3)
    for (const auto& face : kFaces)
      addTriangle(inside(std::array{at[face[0]], at[face[1]], at[face[2]]}, order), order - 3, out);
  if (order >= 4) addTetrahedron(inside(at, order), order - 4, out);
}

/// Calls add() for nodes of hexahedra and wedges: nodes with each axis from first to last, i fastest.
template <typename Add>
void forBox(const Place& first, const Place& last, const Add& add) {
  for (int k = first[2]; k <= last[2]; ++k)
    for (int j = first[1]; j <= last[1]; ++j)
      for (int i = first[0]; i <= last[0]; ++i)
        add(Place{static_cast<uint8_t>(i), static_cast<uint8_t>(j), static_cast<uint8_t>(k)});
}

}  // namespace

std::array<uint8_t, 3> ordersOf(CellCurve curve) {
  return {curve.order, curve.rows > 0 ? curve.rows : curve.order, curve.layers};
}

CellCurve curveOf(CellKind shape, size_t nodes) {
  if (shape == CellKind::kHexahedron && (nodes == 20 || nodes == 24)) return {2, 2, false};
  if (shape == CellKind::kWedge && nodes == 15) return {2, 2, false};
  if (shape == CellKind::kWedge && nodes == 12) return {2, 1};
  if (shape == CellKind::kPyramid && nodes == 13) return {2, 2, false};
  if (shape == CellKind::kPyramid && (nodes == 14 || nodes == 19)) return {2, 2};
  for (size_t n = 2; n <= kMaxCurveOrder; ++n) {
    const size_t next = n + 1, all = shape == CellKind::kTetrahedron  ? next * (n + 2) * (n + 3) / 6
                                     : shape == CellKind::kWedge      ? next * next * (n + 2) / 2
                                     : shape == CellKind::kHexahedron ? next * next * next
                                     : n > 2                          ? next * (n + 2) * (2 * n + 3) / 6
                                                                      : 0;
    if (nodes == all) return {static_cast<uint8_t>(n), static_cast<uint8_t>(n)};
  }
  return {};
}

std::vector<std::array<uint8_t, 3>> nodesOf(CellKind shape, CellCurve curve) {
  const auto n = static_cast<int>(curve.order);
  const std::vector<Place> at = cornersAt(shape, curve);
  std::vector<Place> places;
  if (shape == CellKind::kTetrahedron) {
    addTetrahedron({at[0], at[1], at[2], at[3]}, n, places);
    return places;
  }
  places = at;
  for (const Edge& edge : edgesOf(shape)) addLine(at[edge[0]], at[edge[1]], places);
  if (!curve.complete) return places;
  const uint8_t before_n = static_cast<uint8_t>(n - 1), m = curve.layers,
                before_m = static_cast<uint8_t>(m - 1);
  const auto add = [&](const Place& place) { places.push_back(place); };
  if (shape == CellKind::kPyramid) {
    // The base, then one layer after another: what is not on an edge.
    const std::vector<Place> known = places;
    for (uint8_t k = 0; k < n; ++k)
      forBox({0, 0, k}, {static_cast<uint8_t>(n - k), static_cast<uint8_t>(n - k), k},
             [&](const Place& place) {
               if (std::find(known.begin(), known.end(), place) == known.end()) places.push_back(place);
             });
  } else if (shape == CellKind::kHexahedron) {
    const uint8_t r = ordersOf(curve)[1], before_r = static_cast<uint8_t>(r - 1);
    for (const uint8_t i : {uint8_t{0}, curve.order}) forBox({i, 1, 1}, {i, before_r, before_m}, add);
    for (const uint8_t j : {uint8_t{0}, r}) forBox({1, j, 1}, {before_n, j, before_m}, add);
    for (const uint8_t k : {uint8_t{0}, m}) forBox({1, 1, k}, {before_n, before_r, k}, add);
    forBox({1, 1, 1}, {before_n, before_r, before_m}, add);
  } else {
    const auto addInner = [&](const Place& place) {
      if (place[0] + place[1] < n) add(place);
    };
    for (const uint8_t k : {uint8_t{0}, m}) forBox({1, 1, k}, {before_n, before_n, k}, addInner);
    for (size_t side = 0; side < 3; ++side)
      for (uint8_t k = 1; k < m; ++k) {
        Place from = at[side], to = at[(side + 1) % 3];
        from[2] = to[2] = k;
        addLine(from, to, places);
      }
    forBox({1, 1, 1}, {before_n, before_n, before_m}, addInner);
  }
  return places;
}

const std::vector<std::vector<uint8_t>>& middlesOf(CellKind shape) {
  using Middles = std::vector<std::vector<uint8_t>>;
  static const std::map<CellKind, Middles> known = [] {
    std::map<CellKind, Middles> middles;
    for (const CellKind kind :
         {CellKind::kTetrahedron, CellKind::kPyramid, CellKind::kWedge, CellKind::kHexahedron}) {
      const std::vector<Place> places = nodesOf(kind, kHalved);
      const size_t corners = cornersOf(kind);
      for (size_t n = corners; n < places.size(); ++n) {
        std::vector<uint8_t>& between = middles[kind].emplace_back();
        // Each of them has an opposite one, which may be of the same edge, face or cell.
        for (size_t corner = 0; corner < corners; ++corner)
          for (size_t opposite = 0; opposite < corners; ++opposite) {
            bool is_middle = true;
            for (size_t axis = 0; axis < 3; ++axis)
              is_middle &= places[corner][axis] + places[opposite][axis] == 2 * places[n][axis];
            if (is_middle) between.push_back(static_cast<uint8_t>(corner));
          }
      }
    }
    return middles;
  }();
  return known.at(shape);
}

void appendCurved(CellKind shape, std::span<const uint64_t> nodes, MeshCells& out) {
  if (nodes.size() <= cornersOf(shape)) return out.append(shape, nodes);
  out.appendCurved(shape, curveOf(shape, nodes.size()), nodes);
}

void appendCurvedAsExodus(CellKind shape, bool is_cgns, std::span<uint64_t> nodes, MeshCells& out) {
  const CellCurve curve = curveOf(shape, nodes.size());
  if (curve.order != 2)
    return nodes.size() > cornersOf(shape) ? out.appendCurved(shape, CellCurve{}, nodes)
                                           : out.append(shape, nodes);
  const auto swapEdges = [&](size_t begin, size_t count) {
    std::swap_ranges(nodes.begin() + static_cast<ptrdiff_t>(begin),
                     nodes.begin() + static_cast<ptrdiff_t>(begin + count),
                     nodes.begin() + static_cast<ptrdiff_t>(begin + count));
  };
  if (shape == CellKind::kWedge) swapEdges(9, 3);
  if (shape == CellKind::kHexahedron) swapEdges(12, 4);
  if (shape == CellKind::kHexahedron && curve.complete) {
    constexpr std::array<size_t, 7> kCgns{24, 22, 21, 23, 20, 25, 26}, kExodus{23, 24, 25, 26, 21, 22, 20};
    std::array<uint64_t, 7> centres;
    for (size_t n = 0; n < centres.size(); ++n) centres[n] = nodes[(is_cgns ? kCgns : kExodus)[n]];
    std::copy(centres.begin(), centres.end(), nodes.begin() + 20);
  }
  out.appendCurved(shape, curve, nodes);
}

void CellParts::add(CellKind kind, std::span<const uint16_t> corners) {
  kinds_.push_back(kind);
  corners_.insert(corners_.end(), corners.begin(), corners.end());
  begin_.push_back(corners_.size());
}

CellParts::CellParts(CellKind shape, CellCurve curve) {
  if (!curve.complete) {
    cutAtMiddles(shape);
    return;
  }
  std::map<Place, uint16_t> node_at;
  const std::vector<Place> places = nodesOf(shape, curve);
  for (size_t n = 0; n < places.size(); ++n) node_at.emplace(places[n], static_cast<uint16_t>(n));
  Place from;  // of the part
  const auto part = [&](CellKind kind, std::initializer_list<Place> steps) {
    std::vector<uint16_t> corners;
    for (const Place& step : steps)
      corners.push_back(
          node_at.at({static_cast<uint8_t>(from[0] + step[0]), static_cast<uint8_t>(from[1] + step[1]),
                      static_cast<uint8_t>(from[2] + step[2])}));
    add(kind, corners);
  };
  const auto tetrahedron = [&](std::initializer_list<Place> steps) { part(CellKind::kTetrahedron, steps); };
  const std::array<uint8_t, 3> orders = ordersOf(curve);
  const uint8_t n = curve.order;
  const auto before = [](uint8_t order) { return static_cast<uint8_t>(order - 1); };
  forBox({0, 0, 0}, {before(n), before(orders[1]), before(orders[2])}, [&](const Place& place) {
    from = place;
    const int i = place[0], j = place[1], k = place[2], left = n - i - j;
    if (shape == CellKind::kHexahedron) {
      part(shape, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}});
    } else if (shape == CellKind::kWedge) {
      if (left >= 1) part(shape, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}});
      if (left >= 2) part(shape, {{1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}});
    } else if (shape == CellKind::kTetrahedron) {
      if (left - k >= 1) tetrahedron({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
      if (left - k >= 2) {  // an octahedron, around one of its diagonals
        tetrahedron({{1, 0, 0}, {0, 1, 1}, {0, 1, 0}, {1, 1, 0}});
        tetrahedron({{1, 0, 0}, {0, 1, 1}, {1, 1, 0}, {1, 0, 1}});
        tetrahedron({{1, 0, 0}, {0, 1, 1}, {1, 0, 1}, {0, 0, 1}});
        tetrahedron({{1, 0, 0}, {0, 1, 1}, {0, 0, 1}, {0, 1, 0}});
      }
      if (left - k >= 3) tetrahedron({{1, 1, 0}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}});
    } else {
      const int along = n - k;  // pyramids of this layer
      if (i >= along || j >= along) return;
      part(shape, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}});
      if (i + 1 < along && j + 1 < along)
        part(shape, {{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {1, 1, 0}});
      if (i + 1 < along) tetrahedron({{1, 0, 0}, {1, 1, 0}, {0, 0, 1}, {1, 0, 1}});
      if (j + 1 < along) tetrahedron({{0, 1, 0}, {1, 1, 0}, {0, 0, 1}, {0, 1, 1}});
    }
  });
}

/// Cuts off a piece at each corner, as far as the middles of its edges, and leaves a polyhedron of all middles.
void CellParts::cutAtMiddles(CellKind shape) {
  const size_t corners = cornersOf(shape);
  const std::span<const Edge> edges = edgesOf(shape);
  const auto middle = [&](size_t a, size_t b) {
    const auto found = std::find_if(edges.begin(), edges.end(), [&](const Edge& edge) {
      return edge == Edge{a, b} || edge == Edge{b, a};
    });
    return static_cast<uint16_t>(corners + static_cast<size_t>(found - edges.begin()));
  };
  std::vector<uint16_t> rest;  // its faces
  std::vector<std::vector<std::array<uint16_t, 2>>> around(
      corners);  // [corner]: sides of the face that is cut there
  const std::span<const uint32_t> faces = facesOf(shape, {});
  for (size_t at = 0; at < faces.size(); at += faces[at] + 1) {
    const auto of_face = faces.subspan(at + 1, faces[at]);
    rest.push_back(static_cast<uint16_t>(of_face.size()));
    for (size_t n = 0; n < of_face.size(); ++n) {
      const size_t before = of_face[(n + of_face.size() - 1) % of_face.size()], here = of_face[n],
                   next = of_face[(n + 1) % of_face.size()];
      rest.push_back(middle(here, next));
      around[here].push_back({middle(before, here), middle(here, next)});
    }
  }
  for (size_t corner = 0; corner < corners; ++corner) {
    std::vector<uint16_t> ring{around[corner][0][0], around[corner][0][1]};
    while (ring.size() < around[corner].size())
      for (const auto& side : around[corner]) {
        const uint16_t end = side[0] == ring.back()   ? side[1]
                             : side[1] == ring.back() ? side[0]
                                                      : ring.front();
        if (ring.size() < around[corner].size() && std::find(ring.begin(), ring.end(), end) == ring.end())
          ring.push_back(end);
      }
    rest.push_back(static_cast<uint16_t>(ring.size()));
    rest.insert(rest.end(), ring.begin(), ring.end());
    ring.push_back(static_cast<uint16_t>(corner));
    add(ring.size() == 4 ? CellKind::kTetrahedron : CellKind::kPyramid, ring);
  }
  add(CellKind::kPolyhedron, rest);
}

void CellParts::append(size_t n, std::span<const uint64_t> nodes, MeshCells& out) const {
  const auto part = std::span<const uint16_t>(corners_).subspan(begin_[n], begin_[n + 1] - begin_[n]);
  std::array<uint64_t, 8> corners;
  if (kinds_[n] != CellKind::kPolyhedron) {
    for (size_t corner = 0; corner < part.size(); ++corner) corners[corner] = nodes[part[corner]];
    return out.append(kinds_[n], std::span(corners).first(part.size()));
  }
  std::vector<uint64_t> stream;
  uint64_t faces = 0;
  for (size_t at = 0; at < part.size(); at += part[at] + size_t{1}, ++faces) {
    stream.push_back(part[at]);
    for (size_t corner = 1; corner <= part[at]; ++corner) stream.push_back(nodes[part[at + corner]]);
  }
  out.appendPolyhedron(faces, stream);
}

const CellParts& partsOf(CellKind shape, CellCurve curve) {
  static Mutex mutex;
  static std::map<std::pair<CellKind, CellCurve>, std::unique_ptr<const CellParts>> known;
  const MutexLock lock(mutex);
  auto& parts = known[{shape, curve}];
  if (!parts) parts = std::make_unique<const CellParts>(shape, curve);
  return *parts;
}

}  // namespace curvisplat
