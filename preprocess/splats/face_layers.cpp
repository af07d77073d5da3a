#include "preprocess/splats/face_layers.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/base/error.h"
#include "stream/model/border_code.h"
#include "stream/model/fits.h"

namespace curvisplat {

LayeredBorder layeredBorder(std::span<const glm::dvec3> ends, std::span<const LayerAxis> layers) {
  CURVISPLAT_CHECK_OP(ends.size() + layers.size(), <=, size_t{3});
  if (layers.empty()) return {packBorderCode(ends, (1u << ends.size()) - 1), 0};
  std::array<glm::dvec3, 3> axes{};
  std::array<uint8_t, 3> of_lattice{};  // 1 and the axis
  size_t count = 0;
  for (const glm::dvec3& end : ends) axes[count++] = end;
  for (const LayerAxis& layer : layers) {
    of_lattice[count] = static_cast<uint8_t>(layer.axis + 1);
    axes[count++] = layer.inward;
  }
  if (layers.size() == 3 && glm::dot(glm::cross(axes[0], axes[1]), axes[2]) < 0) {
    std::swap(axes[0], axes[1]);
    std::swap(of_lattice[0], of_lattice[1]);
  }
  LayeredBorder border;
  border.code = count == 1 ? packLayerCode(axes[0], layers[0].distance)
                           : packLayersCode({axes.data(), count}, ends.size());
  if (border.code == kNoBorder) return border;
  for (size_t n = 0; n < count; ++n) border.layers |= static_cast<uint8_t>(of_lattice[n] << 2 * n);
  return border;
}

LayeredBorder withoutSeams(const LayeredBorder& border, uint32_t axes) {
  const InwardAxes inward = inwardAxes(border.code);
  std::array<glm::dvec3, 3> ends{};
  std::array<LayerAxis, 3> layers{};
  size_t end_count = 0, layer_count = 0;
  bool any_seam = false;
  for (int n = 0; n < 3; ++n) {
    const glm::dvec3 axis(inward.axis[static_cast<size_t>(n)]);
    const int of_lattice = latticeAxis(border.layers, n);
    if (of_lattice < 0) {
      if (n < inward.count) ends[end_count++] = axis;
    } else if ((axes >> of_lattice & 1) != 0) {
      any_seam = true;
    } else {
      layers[layer_count++] = {axis, static_cast<uint8_t>(of_lattice), layerDistance(0)};
    }
  }
  if (!any_seam) return border;
  return layeredBorder({ends.data(), end_count}, {layers.data(), layer_count});
}

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
  // In a plane n · (x - X0) = 0, A⁻¹ (x - X0) is at right angles to Aᵀ n.
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

namespace {

/// The excess that counts of x, by the row of a cell one away from the face.
double excessOf(const CellRow& row) {
  constexpr double kLeft = 0.08, kFaded = 0.12, kMost = 0.25;
  const Stretch stretch = stretchOfRow(row, StretchFit::kSteep);
  const auto squared = [&](size_t n) { return row[n] * row[n]; };
  // extentsOnLine() has shortened the cell at the face by the steady growth.
  const double growth = std::sqrt(steadyGrowth(squared(2), squared(3), squared(4)));
  const double last_step = row[1] / (0.5 + 0.5 / growth);
  const double to_face = 0.5 * (1 + last_step / row[2]) + static_cast<double>(stretch.drift);
  const double x = std::log(static_cast<double>(stretch.factor * layerDistance(stretch.growth)) / to_face);
  if (!(x > kLeft)) return 0;
  return std::min({(x - kLeft) * kFaded / (kFaded - kLeft), x, kMost});
}

/// The row of the cell one away from the face, of the line of the half cell at it. Its last cell is not
/// known: steps from node to node go on as they did.
CellRow rowOfNext(const JointLine& line) {
  const CellRow row = line.row();
  const double first = 2 * line.unit(), second = 2 * row[3] - first, third = 2 * row[4] - second;
  const double last = second > 0 && third > 0 ? 0.5 * third * (1 + third / second) : row[4];
  return {row[1], row[2], row[3], row[4], last};
}

LayerFit fitOf(const ShortLastCell& cell, double x) {
  return {std::exp(cell.length * x), cell.growth * x, cell.drift * x};
}

}  // namespace

LayerFit fitBehindFace(const JointLine& line) {
  return fitOf(kShortBehindFace, excessOf(line.row()));
}

LayerFit fitAtFace(const JointLine& line) {
  return fitOf(kShortAtFace, excessOf(rowOfNext(line)));
}

bool fitToLayers(const CellAtFaces& at, const CellOnLattice& cell) {
  const auto way = [&](int axis) { return at.inwards[axis] != 0 ? at.inwards[axis] : at.layers[axis]; };
  if ((way(0) != 0) + (way(1) != 0) + (way(2) != 0) < 2) return false;
  for (int axis = 0; axis < 3; ++axis) {
    if (!at.lines[axis].isThere()) continue;
    // Uses the rounded row: if the face turns out to be a joint, nothing else is left to undo this
    // (joint_sides.cpp).
    const bool is_half = at.inwards[axis] != 0;
    const LayerFit fit = is_half ? fitAtFace(at.lines[axis]) : fitBehindFace(at.lines[axis]);
    cell.stretch[axis] *= fit.factor;
    const auto growth = static_cast<float>(way(axis) * fit.growth);
    cell.growth[axis] = std::clamp(cell.growth[axis] + growth, -kLargestGrowth, kLargestGrowth);
    cell.middle[axis] = is_half ? cell.middle[axis] * fit.factor : cell.middle[axis] + way(axis) * fit.drift;
  }
  return true;
}

}  // namespace curvisplat
