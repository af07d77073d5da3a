// Which edges of a grid's faces lie beside one another: of the cube of a cubed sphere, of MITgcm's "lat-lon-cap", of
// tiles. Found by the places of the nodes alone, so that no model's table of contacts is needed.
//
//            +--------+        Values are at the centres of a model's cells, so that the last nodes of a face and
//            |  face  |        the first ones of the next are a step apart: a joint. Where joints meet, a hole of
//            |   3    |        three (at a cube's corner) or four corners of faces is left.
//   +--------+--------+
//   |  face  |  face  |        Edges whose nodes coincide need no joint, and edges that no other lies beside are
//   |   1    |   2    |        open: MITgcm's faces end at Antarctica.
//   +--------+--------+
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

namespace curvisplat {

/// The nodes of a face with the first or last i or j. They are numbered along the edge: by j at the ends of i, and by
/// i at the ends of j.
struct FaceEdge {
  enum class Side : uint8_t { kFirstI, kLastI, kFirstJ, kLastJ };
  uint32_t face = 0;
  Side side = Side::kFirstI;
  bool alongJ() const { return side == Side::kFirstI || side == Side::kLastI; }
  bool last() const { return side == Side::kLastI || side == Side::kLastJ; }
};

/// Two edges of as many nodes, a step apart. Node n of `a` is beside node n of `b`, or the n-th from its end.
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

/// The points of an edge on the unit sphere, or those `inwards` rows from it. Not finite where there are none.
using EdgePoints = std::function<std::vector<glm::dvec3>(const FaceEdge& edge, uint64_t inwards)>;

/// Keeps the points of two rows of every edge. Throws what `points` throws.
FaceJoints jointsOf(const FaceShape& shape, const EdgePoints& points);

}  // namespace curvisplat
