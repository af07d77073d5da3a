#include "preprocess/formats/netcdf/joined_faces.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "preprocess/formats/netcdf/face_joints.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

// Nodes of an edge are read for this many at a time, which bounds the buffers.
constexpr uint64_t kNodesAtATime = 1 << 16;
// Points of all edges, which are compared in memory: 32 MiB. A cubed sphere of 1 km has a fifth of them.
constexpr uint64_t kMaxEdgePoints = 1 << 20;

/// A column of the source.
struct Column {
  uint32_t face = 0;
  uint64_t i = 0, j = 0;
};

/// The four columns of a hole, i fastest. A hole of three corners has one of them twice.
using Hole = std::array<Column, 4>;

class JoinedFaces final : public GridSource {
 public:
  explicit JoinedFaces(std::unique_ptr<FaceSource> source)
      : source_(std::move(source)), description_(source_->description()) {
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

  const GridDescription& description() const override { return description_; }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    if (block < shape_.faces) return source_->read(block, box, scalars, out);
    CURVISPLAT_CHECK_OP(block, <, description_.blocks.size());
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

  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    if (block < shape_.faces) return source_->readPartOfRows(block, box, scalars, out);
    GridSource::readPartOfRows(block, box, scalars, out);  // two nodes a row
  }
  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override {
    return source_->rowsInMemory(scalars);
  }

 private:
  /// Where nodes read from the source go: node (row, level) to `first + 2 * (row + rows * level)`.
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
    return source_->pointsOf(edge.face, rangeOf(edge, inwards, 0, lengthOf(edge)));
  }

  glm::dvec3 pointOf(const Column& c) const {
    return source_->pointsOf(c.face, {{c.i, c.j, 0}, {c.i + 1, c.j + 1, 1}}).at(0);
  }

  /// In such an order that the block has the handedness of the first corner's face.
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
    source_->readPart(face, range, scalars, part);
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

  /// Across, the block goes the way that i or j goes on the face of `a`; along, so that it has the face's handedness.
  void readJoint(const FaceJoint& joint, const NodeBox& box, std::span<const uint32_t> scalars,
                 NodeArrays& out) const {
    const uint64_t length = lengthOf(joint.a), rows = box.j1 - box.j0;
    const uint64_t piece = std::max<uint64_t>(1, kNodesAtATime / rows);
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

  std::unique_ptr<FaceSource> source_;
  FaceShape shape_;
  std::vector<FaceJoint> joints_;
  std::vector<Hole> holes_;
  GridDescription description_;
};

}  // namespace

std::unique_ptr<GridSource> joinFaces(std::unique_ptr<FaceSource> source) {
  if (!source->onSphere()) return source;
  return std::make_unique<JoinedFaces>(std::move(source));
}

}  // namespace curvisplat
