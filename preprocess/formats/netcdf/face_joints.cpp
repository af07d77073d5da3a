#include "preprocess/formats/netcdf/face_joints.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

namespace curvisplat {
namespace {

using Side = FaceEdge::Side;
using Row = std::vector<glm::dvec3>;

constexpr std::array<Side, 4> kSides{Side::kFirstI, Side::kLastI, Side::kFirstJ, Side::kLastJ};
// Nodes of two edges are a step apart if their distance is this many of the face's own steps. At the corners of a
// cube, steps differ from their neighbours'.
constexpr double kMinStep = 0.3, kMaxSteps = 2;
// Share of an edge's nodes that may lie elsewhere, since land may have no coordinates.
constexpr double kMayMiss = 0.1;
// Edges of one face are a step or two apart if it has fewer nodes across. They are neighbours only if it runs around the
// Earth.
constexpr size_t kMinNodesAround = 5;

struct Edge {
  FaceEdge edge;
  Row row;
  std::vector<double> steps;  // to the next row inwards
};

/// The mean distance in steps, if the nodes of the edges are a step apart.
std::optional<double> apart(const Edge& a, const Edge& b, bool reversed) {
  const size_t n = a.row.size();
  if (b.row.size() != n) return std::nullopt;
  const auto may_miss = static_cast<size_t>(kMayMiss * static_cast<double>(n));
  size_t missed = 0;
  double sum = 0;
  for (size_t m = 0; m < n; ++m) {
    const double steps = glm::distance(a.row[m], b.row[reversed ? n - 1 - m : m]) / a.steps[m];
    if (steps > kMinStep && steps < kMaxSteps)
      sum += steps;
    else if (++missed > may_miss)
      return std::nullopt;
  }
  return sum / static_cast<double>(n - missed);
}

/// Joints by increasing distance, each edge in one at most.
std::vector<FaceJoint> nearestJoints(const std::vector<Edge>& edges, const FaceShape& shape) {
  const bool joins_itself = std::min(shape.ni, shape.nj) >= kMinNodesAround;
  struct Candidate {
    double distance;
    size_t a, b;
    bool reversed;
  };
  std::vector<Candidate> candidates;
  for (size_t a = 0; a < edges.size(); ++a)
    for (size_t b = a + 1; b < edges.size(); ++b) {
      if (edges[a].edge.face == edges[b].edge.face && !joins_itself) continue;
      for (const bool reversed : {false, true})
        if (const auto distance = apart(edges[a], edges[b], reversed))
          candidates.push_back({*distance, a, b, reversed});
    }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& one, const Candidate& two) { return one.distance < two.distance; });
  std::vector<FaceJoint> joints;
  std::vector<uint8_t> taken(edges.size());
  for (const Candidate& candidate : candidates) {
    if (taken[candidate.a] || taken[candidate.b]) continue;
    taken[candidate.a] = taken[candidate.b] = 1;
    joints.push_back({edges[candidate.a].edge, edges[candidate.b].edge, candidate.reversed});
  }
  return joints;
}

/// The number of a corner among all: four for each face.
size_t numberOf(const FaceEdge& edge, bool at_end) {
  const bool last_i = edge.alongJ() ? edge.last() : at_end, last_j = edge.alongJ() ? at_end : edge.last();
  return 4 * size_t{edge.face} + (last_i ? 1 : 0) + (last_j ? 2 : 0);
}

/// Corners of faces that joints link to rings.
std::vector<std::vector<FaceCorner>> holesBetween(const std::vector<FaceJoint>& joints, uint32_t faces) {
  std::vector<std::vector<size_t>> links(4 * size_t{faces});
  for (const FaceJoint& joint : joints)
    for (const bool at_end : {false, true}) {
      const size_t a = numberOf(joint.a, at_end), b = numberOf(joint.b, at_end != joint.reversed);
      links[a].push_back(b);
      links[b].push_back(a);
    }
  std::vector<std::vector<FaceCorner>> holes;
  std::vector<uint8_t> seen(links.size());
  for (size_t first = 0; first < links.size(); ++first) {
    if (seen[first] || links[first].size() != 2) continue;
    std::vector<FaceCorner> ring;
    size_t before = links[first][1], at = first;
    do {
      seen[at] = 1;
      ring.push_back({static_cast<uint32_t>(at / 4), at % 2 == 1, at / 2 % 2 == 1});
      if (links[at].size() != 2) break;
      const size_t next = links[at][0] == before ? links[at][1] : links[at][0];
      before = at;
      at = next;
    } while (at != first && ring.size() <= 4);
    if (at == first && (ring.size() == 3 || ring.size() == 4)) holes.push_back(std::move(ring));
  }
  return holes;
}

}  // namespace

FaceJoints jointsOf(const FaceShape& shape, const EdgePoints& points) {
  std::vector<Edge> edges;
  for (uint32_t face = 0; face < shape.faces; ++face)
    for (const Side side : kSides) {
      Edge edge{{face, side}, points({face, side}, 0), {}};
      const Row inner = points({face, side}, 1);
      for (size_t n = 0; n < edge.row.size(); ++n)
        edge.steps.push_back(glm::distance(edge.row[n], inner.at(n)));
      edges.push_back(std::move(edge));
    }
  FaceJoints found;
  found.joints = nearestJoints(edges, shape);
  found.holes = holesBetween(found.joints, shape.faces);
  return found;
}

}  // namespace curvisplat
