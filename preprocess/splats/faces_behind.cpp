#include "preprocess/splats/faces_behind.h"

#include <cmath>
#include <glm/geometric.hpp>

namespace curvisplat {
namespace {

constexpr double kMinAcross = 1e-5;  // sine of an inward direction's angle with its face

}  // namespace

FacesBehind::Face FacesBehind::faceOf(const NodeBehind& behind, int axis) const {
  const auto [at, neighbours, layers] = behind;
  const uint8_t* const blank = lattice_.blank;
  const bool is_upper = layers[axis] < 0;
  Face face{at + (is_upper ? neighbours.after[axis] : neighbours.before[axis]), neighbours};
  Neighbours& beside = face.beside;
  const std::array<int, 2> others{(axis + 1) % 3, (axis + 2) % 3};
  for (const int other : others) {
    if (blank[face.node + beside.before[other]]) beside.before[other] = 0;
    if (blank[face.node + beside.after[other]]) beside.after[other] = 0;
  }
  beside.before[axis] = is_upper ? at - face.node : 0;
  beside.after[axis] = is_upper ? 0 : at - face.node;
  const auto position = [&](ptrdiff_t node) { return lattice_.position(node); };
  const auto along = [&](int other) {
    return position(face.node + beside.after[other]) - position(face.node + beside.before[other]);
  };
  const glm::dvec3 inward = position(at) - position(face.node);
  face.position = position(face.node);
  const glm::dvec3 normal = glm::cross(along(others[0]), along(others[1]));
  if (middles_) {
    for (const int other : others) {
      if (beside.before[other] == 0 || beside.after[other] == 0) continue;
      const glm::dvec3 to_before = position(face.node) - position(face.node + beside.before[other]);
      const glm::dvec3 to_after = position(face.node + beside.after[other]) - position(face.node);
      face.position += asideOf(to_before, to_after, glm::length(to_before), glm::length(to_after));
    }
  }
  const double across = glm::dot(normal, inward);
  if (!(std::abs(across) > kMinAcross * glm::length(normal) * glm::length(inward))) return face;
  face.normal = across < 0 ? -normal : normal;
  return face;
}

std::optional<CutBehindFace> FacesBehind::cutAtOne(const NodeBehind& behind, int axis,
                                                   const Splat& splat) const {
  const Face face = faceOf(behind, axis);
  if (face.normal == glm::dvec3(0.0)) return std::nullopt;
  // Of a plane n · (x - X0) = 0, A⁻¹ (x - X0) is at right angles to Aᵀ n.
  const glm::dvec3 in_frame = face.normal * splat.factor();
  const double length = glm::length(in_frame);
  const uint32_t code =
      packLayerCode(in_frame / length, glm::dot(face.normal, splat.position - face.position) / length);
  if (code == kNoBorder) return std::nullopt;
  return CutBehindFace{code, lattice_.position(face.node), lattice_.spacing(face.node, face.beside)};
}

CutBehindFaces FacesBehind::cutAtSeveral(const NodeBehind& behind, const std::array<double, 3>& inwards,
                                         const glm::dmat3& along, const Splat& splat) const {
  constexpr double kAlong = 0.8;                     // cosine of the lattice's axis with the face's normal
  constexpr double kNearest = 0.6, kFarthest = 1.6;  // face, in cells
  const Neighbours& neighbours = behind.neighbours;
  CutBehindFaces cut;
  std::array<glm::dvec3, 3> ends{};
  std::array<LayerAxis, 3> layers{};
  size_t end_count = 0;
  for (int axis = 0; axis < 3; ++axis) {
    if (inwards[axis] != 0) {
      ends[end_count++] = along[axis];
      continue;
    }
    if (behind.layers[axis] == 0 || neighbours.before[axis] == 0 || neighbours.after[axis] == 0) continue;
    const Face face = faceOf(behind, axis);
    const glm::dvec3 in_frame = face.normal * splat.factor();
    const double length = glm::length(in_frame);
    const double distance = glm::dot(face.normal, splat.position - face.position) / length;
    const bool is_even =
        glm::dot(in_frame, along[axis]) > kAlong * length && distance > kNearest && distance < kFarthest;
    if (!is_even) continue;
    layers[cut.count] = {along[axis], static_cast<uint8_t>(axis), distance};
    cut.probes[cut.count++] = {static_cast<uint8_t>(axis), lattice_.position(face.node),
                               lattice_.spacing(face.node, face.beside)};
  }
  if (cut.count > 0) cut.border = layeredBorder({ends.data(), end_count}, {layers.data(), cut.count});
  return cut;
}

}  // namespace curvisplat
