#include "preprocess/overset/sample_cells.h"

#include <algorithm>
#include <limits>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/parallel.h"

namespace curvisplat {

SampleCells::SampleCells(const GridBlock& block, const LoadedSlab& loaded, std::vector<uint8_t> fringe,
                         Centring centring)
    : loaded_(&loaded), centring_(centring), fringe_(std::move(fringe)) {
  const NodeBox& window = loaded.slab.window;
  const uint64_t row = window.rowNodes(block.ni), rows = window.j1 - window.j0,
                 planes = window.k1 - window.k0;
  strides_ = {1, row, row * rows};
  counts_ = {row, rows, planes};
  const NodeArrays& nodes = loaded.nodes;
  const bool cells = centring == Centring::kCell;
  sizes_.assign(nodes.x.size(), kNoCell);
  there_.assign(nodes.x.size(), 0);
  parallelFor(uint64_t{0}, planes, [&](uint64_t k) {
    for (uint64_t j = 0; j < rows; ++j)
      for (uint64_t i = 0; i < row; ++i) {
        const size_t at = k * strides_[2] + j * strides_[1] + i;
        const bool has_cell = i + 1 < row && j + 1 < rows && k + 1 < planes;
        if (has_cell)
          sizes_[at] = cellSize(
              cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), at, strides_[1], strides_[2]));
        if (cells)
          there_[at] = has_cell && nodes.blank[at] == 0 &&
                       (cornerMarks(nodes.blank.data(), at, strides_[1], strides_[2]) & kNoNode) == 0;
        else
          there_[at] = nodes.blank[at] == 0;
      }
  });
}

glm::dvec3 SampleCells::middle(size_t sample) const {
  if (centring_ == Centring::kNode) return position(sample);
  glm::dvec3 sum(0.0);
  for (size_t c = 0; c < 8; ++c)
    sum += position(sample + (c & 1) + (c >> 1 & 1) * strides_[1] + (c >> 2) * strides_[2]);
  return 0.125 * sum;
}

void SampleCells::addTo(BoundingBox& box, size_t sample) const {
  if (centring_ == Centring::kNode) return box.add(position(sample));
  for (size_t c = 0; c < 8; ++c)
    box.add(position(sample + (c & 1) + (c >> 1 & 1) * strides_[1] + (c >> 2) * strides_[2]));
}

std::pair<CellSize, CellSize> SampleCells::sizes(size_t sample) const {
  if (centring_ == Centring::kCell) return {sizes_[sample], sizes_[sample]};
  const auto place = placeOf(sample);
  std::pair<CellSize, CellSize> found{kNoCell, std::numeric_limits<CellSize>::min()};
  for (size_t c = 0; c < 8; ++c) {
    size_t cell = sample;
    bool is_inside = true;
    for (size_t axis = 0; axis < 3; ++axis)
      if (c >> axis & 1) {
        is_inside &= place[axis] > 0;
        cell -= strides_[axis];
      }
    if (!is_inside || sizes_[cell] == kNoCell) continue;
    found.first = std::min(found.first, sizes_[cell]);
    found.second = std::max(found.second, sizes_[cell]);
  }
  if (found.first == kNoCell) found.second = kNoCell;
  return found;
}

CellSize SampleCells::largestAround(size_t sample) const {
  if (centring_ == Centring::kCell) return sizes_[sample];
  const auto place = placeOf(sample);
  CellSize largest = std::numeric_limits<CellSize>::min();
  for (size_t c = 0; c < 8; ++c) {
    size_t cell = sample;
    bool is_inside = true;
    for (size_t axis = 0; axis < 3; ++axis) {
      const bool before = c >> axis & 1;
      is_inside &= before ? place[axis] > 0 : place[axis] + 1 < counts_[axis] || place[axis] == 0;
      if (before) cell -= strides_[axis];
    }
    if (is_inside) largest = std::max(largest, sizes_[cell]);
  }
  return largest;
}

SampleCells::Piece SampleCells::pieceOf(size_t sample) const {
  Piece piece;
  piece.sample = sample;
  piece.middle = middle(sample);
  if (centring_ == Centring::kCell) {
    const NodeArrays& nodes = loaded_->nodes;
    piece.corners =
        cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), sample, strides_[1], strides_[2]);
    return piece;
  }
  const auto place = placeOf(sample);
  for (size_t axis = 0; axis < 3; ++axis) {
    const bool before = place[axis] > 0 && there_[sample - strides_[axis]];
    const bool after = place[axis] + 1 < counts_[axis] && there_[sample + strides_[axis]];
    if (before) piece.before[axis] = piece.middle - position(sample - strides_[axis]);
    if (after) piece.after[axis] = position(sample + strides_[axis]) - piece.middle;
    piece.from[axis] = before ? -0.5 : 0;
    piece.to[axis] = after ? 0.5 : 0;
  }
  return piece;
}

std::pair<glm::dvec3, CellSize> SampleCells::pointOf(const Piece& piece, const glm::dvec3& part) const {
  if (centring_ == Centring::kCell) {
    glm::dvec3 point(0.0);
    for (size_t c = 0; c < 8; ++c) {
      double weight = 1;
      for (int axis = 0; axis < 3; ++axis) weight *= c >> axis & 1 ? 0.5 + part[axis] : 0.5 - part[axis];
      point += weight * piece.corners[c];
    }
    return {point, sizes_[piece.sample]};
  }
  glm::dvec3 point = piece.middle;
  size_t cell = piece.sample;
  const auto place = placeOf(piece.sample);
  for (size_t axis = 0; axis < 3; ++axis) {
    const double from = piece.from[axis], to = piece.to[axis];
    const double at = 0.5 * (from + to) + (to - from) * part[static_cast<int>(axis)];
    point += at * (at < 0 ? piece.before[axis] : piece.after[axis]);
    // A block of one node along an axis has no cells.
    if (at < 0 || place[axis] + 1 == counts_[axis]) cell -= place[axis] > 0 ? strides_[axis] : 0;
  }
  return {point, sizes_[cell]};
}

BoundingBox SampleCells::boxOf(const Piece& piece) const {
  BoundingBox box;
  for (int c = 0; c < 8; ++c)
    box.add(pointOf(piece, {c & 1 ? 0.5 : -0.5, c & 2 ? 0.5 : -0.5, c & 4 ? 0.5 : -0.5}).first);
  return box;
}

}  // namespace curvisplat
