// Two parts: jointsOf() finds which edges of the faces lie beside one another, by the positions of the nodes
// alone, so that no model's table of contacts is needed; JoinedFaces reads the blocks in the gaps.
//
//            +--------+    The last nodes of a face and the first ones of the next are a step apart:
//            |  face  |    a joint. Where joints meet, they leave a hole between three corners of faces
//            |   3    |    (at a cube's corner) or four.
//   +--------+--------+
//   |  face  |  face  |    Edges whose nodes coincide need no joint. Edges that no other lies beside are
//   |   1    |   2    |    open: MITgcm's faces end at Antarctica.
//   +--------+--------+
#include "preprocess/formats/netcdf/joined_faces.h"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// The nodes of a face with the first or last i or j. They are numbered along the edge: by j at the ends of
/// i, and by i at the ends of j.
struct FaceEdge {
  enum class Side : uint8_t { kFirstI, kLastI, kFirstJ, kLastJ };
  uint32_t face = 0;
  Side side = Side::kFirstI;
  bool alongJ() const { return side == Side::kFirstI || side == Side::kLastI; }
  bool last() const { return side == Side::kLastI || side == Side::kLastJ; }
};

/// Two edges of the same number of nodes, a step apart. Node n of `a` is beside node n of `b`, or the n-th
/// from its end.
struct FaceJoint {
  FaceEdge a, b;
  bool reversed = false;
};

/// A node that ends two edges of a face.
struct FaceCorner {
  uint32_t face = 0;
  bool last_i = false, last_j = false;
};

struct FaceJoints {
  std::vector<FaceJoint> joints;
  std::vector<std::vector<FaceCorner>> holes;  // three or four corners, in order around the hole
};

/// Faces of the same dimensions.
struct FaceShape {
  uint32_t faces = 0;
  uint64_t ni = 0, nj = 0;
};

/// The points of an edge on the unit sphere, or those `inwards` rows from it. Not finite where there are
/// none.
using EdgePoints = std::function<std::vector<glm::dvec3>(const FaceEdge& edge, uint64_t inwards)>;

using Side = FaceEdge::Side;
using PointRow = std::vector<glm::dvec3>;

constexpr std::array<Side, 4> kSides{Side::kFirstI, Side::kLastI, Side::kFirstJ, Side::kLastJ};
// Nodes of two edges are a step apart if their distance is this many of the face's own steps. At the corners
// of a cube, steps differ from their neighbours'.
constexpr double kMinStep = 0.3, kMaxSteps = 2;
// Share of an edge's nodes that may lie elsewhere, since land may have no coordinates.
constexpr double kMayMiss = 0.1;
// Edges of one face are a step or two apart if it has fewer nodes across. They are neighbours only if it
// runs around the Earth.
constexpr size_t kMinNodesAround = 5;

struct Edge {
  FaceEdge edge;
  PointRow row;
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
size_t cornerNumber(const FaceEdge& edge, bool at_end) {
  const bool last_i = edge.alongJ() ? edge.last() : at_end, last_j = edge.alongJ() ? at_end : edge.last();
  return 4 * size_t{edge.face} + (last_i ? 1 : 0) + (last_j ? 2 : 0);
}

/// Corners of faces that joints link to rings.
std::vector<std::vector<FaceCorner>> holesBetween(const std::vector<FaceJoint>& joints, uint32_t faces) {
  std::vector<std::vector<size_t>> links(4 * size_t{faces});
  for (const FaceJoint& joint : joints)
    for (const bool at_end : {false, true}) {
      const size_t a = cornerNumber(joint.a, at_end), b = cornerNumber(joint.b, at_end != joint.reversed);
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

/// The joints and holes of the faces. Keeps the points of two rows of every edge. Throws what `points`
/// throws.
FaceJoints jointsOf(const FaceShape& shape, const EdgePoints& points) {
  std::vector<Edge> edges;
  for (uint32_t face = 0; face < shape.faces; ++face)
    for (const Side side : kSides) {
      Edge edge{{face, side}, points({face, side}, 0), {}};
      const PointRow inner = points({face, side}, 1);
      for (size_t n = 0; n < edge.row.size(); ++n)
        edge.steps.push_back(glm::distance(edge.row[n], inner.at(n)));
      edges.push_back(std::move(edge));
    }
  FaceJoints found;
  found.joints = nearestJoints(edges, shape);
  found.holes = holesBetween(found.joints, shape.faces);
  return found;
}

// Nodes of an edge are read for this many at a time, which bounds the buffers.
constexpr uint64_t kEdgeNodesAtATime = 1 << 16;
// Points of all edges, which are compared in memory: 32 MiB. A cubed sphere of 1 km has a fifth of them.
constexpr uint64_t kMaxEdgePoints = 1 << 20;

/// A column of the source.
struct Column {
  uint32_t face = 0;
  uint64_t i = 0, j = 0;
};

/// The four columns of a hole, i fastest. A hole of three corners has one of them twice.
using Hole = std::array<Column, 4>;

class JoinedFaces final : public ForwardingGrid {
 public:
  explicit JoinedFaces(const std::shared_ptr<const FaceSource>& faces)
      : ForwardingGrid(faces), faces_(*faces) {
    const GridBlock& first = description_.blocks[0];
    shape_ = {static_cast<uint32_t>(description_.blocks.size()), first.ni, first.nj};
    const uint64_t edge_points = 2 * shape_.faces * (shape_.ni + shape_.nj);
    if (edge_points > kMaxEdgePoints) {
      description_.warnings.push_back(
          fmt::format("the faces are not joined: their edges have {} points; at most {} are compared",
                      edge_points, kMaxEdgePoints));
    } else {
      const FaceJoints found =
          jointsOf(shape_, [&](const FaceEdge& edge, uint64_t inwards) { return pointsOf(edge, inwards); });
      joints_ = found.joints;
      for (const auto& corners : found.holes) holes_.push_back(holeOf(corners));
    }
    describe();
  }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    if (block < shape_.faces) return ForwardingGrid::read(block, box, scalars, out);
    CURVISPLAT_CHECK_OP(block, <, description_.blocks.size());
    if (!box.hasWholeRows(2)) return GridSource::readPartOfRows(block, box, scalars, out);
    const size_t added = block - shape_.faces;
    const uint64_t nodes = 2 * (box.j1 - box.j0) * (box.k1 - box.k0);
    for (std::vector<double>* axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
    out.blank.resize(nodes);
    out.scalars.resize(scalars.size());
    for (std::vector<float>& values : out.scalars) values.resize(nodes);
    if (added < joints_.size())
      readJoint(joints_[added], box, scalars, out);
    else
      readHole(holes_[added - joints_.size()], box, scalars, out);
  }

 private:
  /// The destination of nodes that are read from the source: node (row, level) to `first + 2 * (row + rows *
  /// level)`.
  struct Target {
    uint64_t first = 0, rows = 0;
    bool backwards = false;  // the first node read is that of the last row
  };

  uint64_t lengthOf(const FaceEdge& edge) const { return edge.alongJ() ? shape_.nj : shape_.ni; }

  /// The nodes [begin, end) of an edge, or of the row `inwards` from it.
  CfRange rangeOf(const FaceEdge& edge, uint64_t inwards, uint64_t begin, uint64_t end) const {
    const uint64_t across = edge.alongJ() ? shape_.ni : shape_.nj;
    const uint64_t at = edge.last() ? across - 1 - inwards : inwards;
    if (edge.alongJ()) return {{at, begin, 0}, {at + 1, end, 1}};
    return {{begin, at, 0}, {end, at + 1, 1}};
  }

  std::vector<glm::dvec3> pointsOf(const FaceEdge& edge, uint64_t inwards) const {
    return faces_.pointsOf(edge.face, rangeOf(edge, inwards, 0, lengthOf(edge)));
  }

  glm::dvec3 pointOf(const Column& c) const {
    return faces_.pointsOf(c.face, {{c.i, c.j, 0}, {c.i + 1, c.j + 1, 1}}).at(0);
  }

  /// The columns around a hole, in such an order that the block has the handedness of the first corner's
  /// face.
  Hole holeOf(const std::vector<FaceCorner>& corners) const {
    std::vector<Column> around;
    for (const FaceCorner& corner : corners)
      around.push_back({corner.face, corner.last_i ? shape_.ni - 1 : 0, corner.last_j ? shape_.nj - 1 : 0});
    const auto turn = [](const glm::dvec3& from, const glm::dvec3& one, const glm::dvec3& two) {
      return glm::dot(from, glm::cross(one - from, two - from));
    };
    const uint32_t face = around[0].face;
    const double of_face = turn(pointOf({face, 0, 0}), pointOf({face, 1, 0}), pointOf({face, 0, 1}));
    const double of_hole = turn(pointOf(around[0]), pointOf(around[1]), pointOf(around[2]));
    if (of_face * of_hole < 0) std::reverse(around.begin(), around.end());
    const Column& last = around.back();
    return {around[0], around[1], last, around[2]};
  }

  void describe() {
    std::vector<std::string> names;
    for (const GridBlock& block : description_.blocks) names.push_back(block.name);
    const uint64_t nk = description_.blocks[0].nk;
    for (const FaceJoint& joint : joints_)
      description_.blocks.push_back({fmt::format("{} to {}", names[joint.a.face], names[joint.b.face]), 2,
                                     lengthOf(joint.a), nk, true});
    for (const Hole& hole : holes_)
      description_.blocks.push_back({fmt::format("corner of {}", names[hole[0].face]), 2, 2, nk, true});
    description_.format += fmt::format(", {} faces", shape_.faces);
    if (!joints_.empty())
      description_.format += fmt::format(" joined at {} edges and {} corners", joints_.size(), holes_.size());
  }

  /// Reads nodes of the source, in the order of increasing i, j and k, to every second node.
  void copyFrom(uint32_t face, const CfRange& range, std::span<const uint32_t> scalars, const Target& target,
                NodeArrays& out) const {
    NodeArrays part;
    const auto& [begin, end] = range;
    faces_.read(face, {begin[1], end[1], begin[2], end[2], begin[0], end[0]}, scalars, part);
    const uint64_t rows = (range.end[0] - range.begin[0]) * (range.end[1] - range.begin[1]);
    const auto copy = [&](const auto& from, auto& to) {
      for (size_t n = 0; n < from.size(); ++n) {
        const uint64_t row = n % rows, level = n / rows;
        to[target.first + 2 * ((target.backwards ? rows - 1 - row : row) + target.rows * level)] = from[n];
      }
    };
    copy(part.x, out.x);
    copy(part.y, out.y);
    copy(part.z, out.z);
    copy(part.blank, out.blank);
    for (size_t s = 0; s < scalars.size(); ++s) copy(part.scalars[s], out.scalars[s]);
  }

  /// Reads a joint's block. Across, the block goes the way that i or j goes on the face of `a`; along, so
  /// that it has the face's handedness.
  void readJoint(const FaceJoint& joint, const NodeBox& box, std::span<const uint32_t> scalars,
                 NodeArrays& out) const {
    const uint64_t length = lengthOf(joint.a), rows = box.j1 - box.j0;
    const uint64_t piece = std::max<uint64_t>(1, kEdgeNodesAtATime / rows);
    const bool backwards_a = !joint.a.alongJ(), backwards_b = backwards_a != joint.reversed;
    for (uint64_t k = box.k0; k < box.k1; k += piece) {
      const uint64_t k1 = std::min(k + piece, box.k1);
      for (const bool is_b : {false, true}) {
        const FaceEdge& edge = is_b ? joint.b : joint.a;
        const bool backwards = is_b ? backwards_b : backwards_a;
        CfRange range =
            backwards ? rangeOf(edge, 0, length - box.j1, length - box.j0) : rangeOf(edge, 0, box.j0, box.j1);
        range.begin[2] = k;
        range.end[2] = k1;
        const uint64_t across = is_b == joint.a.last() ? 1 : 0;
        copyFrom(edge.face, range, scalars, {across + 2 * rows * (k - box.k0), rows, backwards}, out);
      }
    }
  }

  void readHole(const Hole& hole, const NodeBox& box, std::span<const uint32_t> scalars,
                NodeArrays& out) const {
    const uint64_t rows = box.j1 - box.j0;
    for (uint64_t row = box.j0; row < box.j1; ++row)
      for (uint64_t i = 0; i < 2; ++i) {
        const Column& c = hole[i + 2 * row];
        const CfRange range{{c.i, c.j, box.k0}, {c.i + 1, c.j + 1, box.k1}};
        copyFrom(c.face, range, scalars, {i + 2 * (row - box.j0), rows, false}, out);
      }
  }

  const FaceSource& faces_;  // the source
  FaceShape shape_;
  std::vector<FaceJoint> joints_;
  std::vector<Hole> holes_;
};

}  // namespace

std::unique_ptr<GridSource> joinFaces(std::unique_ptr<FaceSource> source) {
  if (!source->onSphere()) return source;
  return std::make_unique<JoinedFaces>(std::move(source));
}

}  // namespace curvisplat
