#include "preprocess/splats/abutting_faces.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "preprocess/splats/coincidence_sweep.h"
#include "preprocess/splats/seam_sorter.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

std::array<uint64_t, 3> cellsOf(const GridBlock& block) {
  const auto along = [](uint64_t nodes) { return std::max<uint64_t>(nodes, 1) - 1; };
  return {along(block.ni), along(block.nj), along(block.nk)};
}

/// The axes along a side.
constexpr std::array<std::array<size_t, 2>, 3> kAlong{{{1, 2}, {0, 2}, {0, 1}}};

uint64_t facesOfSide(const std::array<uint64_t, 3>& cells, size_t axis) {
  return cells[kAlong[axis][0]] * cells[kAlong[axis][1]];
}

/// The mean of the corners whose bits under `mask` are those of `bits`.
glm::dvec3 middle(const std::array<glm::dvec3, 8>& corners, size_t mask, size_t bits) {
  glm::dvec3 sum(0.0);
  int count = 0;
  for (size_t n = 0; n < 8; ++n)
    if (((n ^ bits) & mask) == 0) sum += corners[n], ++count;
  return sum / static_cast<double>(count);
}

}  // namespace

AbuttingFaces::Needs AbuttingFaces::needsOf(std::span<const GridBlock> blocks) {
  uint64_t faces = 0;
  for (const GridBlock& block : blocks)
    for (const size_t axis : {0u, 1u, 2u}) faces += 2 * facesOfSide(cellsOf(block), axis);
  return {faces / 8, faces * SeamSorter::recordBytes(0)};
}

AbuttingFaces::AbuttingFaces(std::span<const GridBlock> blocks, int coordinate_bytes, uint64_t memory_bytes,
                             std::filesystem::path temporary_folder)
    : coordinate_bytes_(coordinate_bytes), centres_(0, memory_bytes, std::move(temporary_folder)) {
  uint64_t faces = 0;
  for (const GridBlock& block : blocks) {
    Block& added = blocks_.emplace_back(Block{cellsOf(block), {}});
    for (const size_t axis : {0u, 1u, 2u}) {
      added.first_face[axis] = faces;
      const uint64_t of_side = facesOfSide(added.cells, axis);
      sides_.insert(sides_.end(), {faces, faces + of_side});
      faces += 2 * of_side;
    }
  }
  abutting_.resize(faces);
}

bool AbuttingFaces::isAtEnd(const CellFace& face) const {
  const auto axis = static_cast<size_t>(face.axis);
  return face.cell[axis] == (face.upper ? blocks_[face.block].cells[axis] - 1 : 0);
}

uint64_t AbuttingFaces::numberOf(const CellFace& face) const {
  const auto& [cells, first_face] = blocks_[face.block];
  const auto axis = static_cast<size_t>(face.axis);
  const auto [a, b] = kAlong[axis];
  return first_face[axis] + (face.upper ? facesOfSide(cells, axis) : 0) + face.cell[b] * cells[a] +
         face.cell[a];
}

AbuttingFaces::Centre AbuttingFaces::centreOf(const CellFace& face,
                                              const std::array<glm::dvec3, 8>& corners) const {
  CURVISPLAT_CHECK(isAtEnd(face));
  const size_t bit = size_t{1} << face.axis, side = face.upper ? bit : 0;
  Centre centre;
  centre.face = numberOf(face);
  centre.at = middle(corners, bit, side);
  const double rounding = coordinateRounding(centre.at, coordinate_bytes_);
  // It is as far to the centre of another face as across this one, or through the cell.
  centre.spacing = std::numeric_limits<double>::infinity();
  for (const size_t other : {1u, 2u, 4u}) {
    const double width =
        glm::distance(middle(corners, bit | other, side), middle(corners, bit | other, side ^ other));
    if (other != bit && !(width > rounding)) centre.collapsed = true;
    if (width > 0) centre.spacing = std::min(centre.spacing, width);
  }
  if (!std::isfinite(centre.spacing)) centre.spacing = 0;
  return centre;
}

void AbuttingFaces::add(std::span<const Centre> centres) {
  for (const Centre& centre : centres) {
    if (centre.collapsed) {
      abutting_[centre.face] = true;
      continue;
    }
    NodeSplat splat;
    splat.node = centre.face;
    splat.on_block_face = true;
    splat.node_position = splat.splat.position = centre.at;
    splat.splat.weight = 1;
    splat.spacing = centre.spacing;
    centres_.add(splat, {});
  }
}

void AbuttingFaces::match(const Progress& progress) {
  centres_.forEachSet(coordinate_bytes_, [&](std::span<const uint64_t> faces) {
    progress.throwIfStopped();
    for (const uint64_t face : faces) abutting_[face] = true;
    if (!folded_.empty()) noteFolds(faces);
  });
}

void AbuttingFaces::noteFolds(std::span<const uint64_t> faces) {
  const auto side_of = [&](uint64_t face) {
    return std::upper_bound(sides_.begin(), sides_.end(), face) - sides_.begin();
  };
  for (size_t n = 1; n < faces.size(); ++n)
    for (size_t other = 0; other < n; ++other)
      if (side_of(faces[n]) == side_of(faces[other])) folded_[faces[n]] = folded_[faces[other]] = true;
}

}  // namespace curvisplat
