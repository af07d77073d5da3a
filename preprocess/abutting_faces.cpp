#include "preprocess/abutting_faces.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stream/error.h"

namespace curvisplat {
namespace {

/// The mean of the corners whose bits under `mask` are `bits`.
glm::dvec3 middle(const std::array<glm::dvec3, 8>& corners, size_t mask, size_t bits) {
  glm::dvec3 sum(0.0);
  int count = 0;
  for (size_t n = 0; n < 8; ++n)
    if ((n & mask) == bits) sum += corners[n], ++count;
  return sum / static_cast<double>(count);
}

}  // namespace

AbuttingFaces::AbuttingFaces(std::span<const GridBlock> blocks, uint64_t memory_bytes,
                             std::filesystem::path temporary_folder)
    : centres_(0, memory_bytes, std::move(temporary_folder)) {
  uint64_t faces = 0;
  for (const GridBlock& block : blocks) {
    const std::array<uint64_t, 3> cells{std::max<uint64_t>(block.ni, 1) - 1,
                                        std::max<uint64_t>(block.nj, 1) - 1,
                                        std::max<uint64_t>(block.nk, 1) - 1};
    blocks_.push_back({cells, faces});
    faces += 2 * (cells[1] * cells[2] + cells[0] * cells[2] + cells[0] * cells[1]);
  }
  abutting_.resize(faces);
}

bool AbuttingFaces::isAtEnd(const CellFace& face) const {
  const size_t axis = static_cast<size_t>(face.axis);
  return face.cell[axis] == (face.upper ? blocks_[face.block].cells[axis] - 1 : 0);
}

uint64_t AbuttingFaces::numberOf(const CellFace& face) const {
  const auto& [cells, first_face] = blocks_[face.block];
  uint64_t number = first_face;
  for (int axis = 0; axis <= face.axis; ++axis) {
    const int b = axis == 0 ? 1 : 0, c = axis == 2 ? 1 : 2;
    const uint64_t a_side = cells[b] * cells[c];
    if (axis < face.axis)
      number += 2 * a_side;
    else
      number += (face.upper ? a_side : 0) + face.cell[c] * cells[b] + face.cell[b];
  }
  return number;
}

void AbuttingFaces::add(const CellFace& face, const std::array<glm::dvec3, 8>& corners) {
  CURVISPLAT_CHECK(isAtEnd(face));
  const size_t bit = size_t{1} << face.axis, side = face.upper ? bit : 0;
  NodeSplat centre;
  centre.node = numberOf(face);
  centre.on_block_face = true;
  centre.node_position = centre.splat.position = middle(corners, bit, side);
  centre.splat.weight = 1;
  // How far it is to the centre of another face, at least: across this one, or through the cell.
  double spacing = std::numeric_limits<double>::infinity();
  for (size_t other = 1; other < 8; other <<= 1) {
    const size_t mask = other == bit ? bit : bit | other;
    const double width = glm::distance(middle(corners, mask, side), middle(corners, mask, side ^ other));
    if (width > 0) spacing = std::min(spacing, width);
  }
  centre.spacing = std::isfinite(spacing) ? spacing : 0;
  centres_.add(centre, {});
}

void AbuttingFaces::match(int coordinate_bytes) {
  centres_.forEachSet(coordinate_bytes, [&](std::span<const uint64_t> faces) {
    for (const uint64_t face : faces) abutting_[face] = true;
  });
}

}  // namespace curvisplat
