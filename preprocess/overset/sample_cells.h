// The pieces of space that the samples of a slab stand for, as points: a node's cell reaches half way to its
// neighbours, a cell is itself.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <utility>
#include <vector>

#include "preprocess/grid/slabs.h"
#include "preprocess/overset/cell_tree.h"
#include "preprocess/survey/bounding_tree.h"

namespace curvisplat {

/// Samples are numbered as the nodes of the slab's window; a cell has the number of its lowest node. Borrows the slab.
/// Immutable; any thread.
class SampleCells {
 public:
  /// `loaded` as a NodeReader of scalars of this centring gives it. Throws nothing but bad_alloc.
  /// `fringe`: [node of the window], or empty.
  SampleCells(const GridBlock& block, const LoadedSlab& loaded, std::vector<uint8_t> fringe,
              Centring centring);

  bool isThere(size_t sample) const { return there_[sample] != 0; }
  /// Whether the grid says that it was interpolated from another block (GridSource::readFringe).
  bool isFringe(size_t sample) const { return !fringe_.empty() && fringe_[sample] != 0; }
  glm::dvec3 middle(size_t sample) const;
  /// Adds a node, or the corners of a cell.
  void addTo(BoundingBox& box, size_t sample) const;
  /// The sizes of the block's cells that the sample has a part of: the smallest and the largest.
  std::pair<CellSize, CellSize> sizes(size_t sample) const;
  /// No less than the size of any of the sample's points (pointOf): kNoCell where a cell around it is none.
  CellSize largestAround(size_t sample) const;

  /// Facts about a sample that its points need.
  struct Piece {
    size_t sample = 0;
    glm::dvec3 middle{0.0};
    std::array<glm::dvec3, 3> before{},
        after{};                          // to the neighbours, or what the cell's faces are from its middle
    std::array<double, 3> from{}, to{};   // the piece along each axis, in these
    std::array<glm::dvec3, 8> corners{};  // of a cell
  };
  Piece pieceOf(size_t sample) const;
  /// `part`: from -1/2 to 1/2 along each axis. A point of the piece, and the size of the block's cell around it.
  std::pair<glm::dvec3, CellSize> pointOf(const Piece& piece, const glm::dvec3& part) const;
  BoundingBox boxOf(const Piece& piece) const;

  size_t elementOf(uint64_t i, uint64_t j, uint64_t k) const {
    const NodeBox& window = loaded_->slab.window;
    return (k - window.k0) * strides_[2] + (j - window.j0) * strides_[1] + (i - window.i0);
  }
  const std::array<size_t, 3>& strides() const { return strides_; }
  /// Samples of the window along i, j and k.
  const std::array<uint64_t, 3>& counts() const { return counts_; }

 private:
  glm::dvec3 position(size_t node) const {
    const NodeArrays& nodes = loaded_->nodes;
    return {nodes.x[node], nodes.y[node], nodes.z[node]};
  }
  std::array<uint64_t, 3> placeOf(size_t sample) const {
    return {sample % strides_[1], sample % strides_[2] / strides_[1], sample / strides_[2]};
  }

  const LoadedSlab* loaded_;
  Centring centring_;
  std::array<size_t, 3> strides_;
  std::array<uint64_t, 3> counts_;
  std::vector<CellSize> sizes_;  // [lowest node], of all cells whose corners are finite
  std::vector<uint8_t> there_, fringe_;
};

}  // namespace curvisplat
