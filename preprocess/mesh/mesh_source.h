// MeshSource, the interface that readers of unstructured grids offer to conversion: points and cells of one or
// more pieces, read in chunks. The unstructured counterpart of GridSource. No source holds a whole mesh in
// memory.
//
// Cells refer to points by their number in the piece. Pieces may repeat one another's points (partitions do):
// points of different pieces at the same position are one point (preprocess/gather/point_numbers.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "preprocess/mesh/mesh_cells.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// Points of one piece. The source resizes the arrays, which keep their capacity.
struct MeshPoints {
  std::vector<double> x, y, z;              // world units
  std::vector<uint8_t> hidden;              // 1: blanked by the file; always filled
  std::vector<std::vector<float>> scalars;  // [requested scalar][point]
};

class MeshSource : public DataSource {
 public:
  /// Points [first, first + count) of a piece, and the node-centred scalars with the given indices in
  /// description().scalars. Any number of threads may read concurrently. Throws Error with the file.
  virtual void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                          MeshPoints& out) const = 0;

  /// Cells [first, first + count) of a piece, and cell-centred scalars. Numbers of points are as stored:
  /// checkCells() (mesh_cells.h) refuses those that do not exist.
  virtual void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                         MeshCells& out) const = 0;

  /// To be called before these scalars are read, in one thread: computes those that are made of the whole mesh,
  /// within `memory_bytes`. May be called again. Throws Interrupted once `progress` is stopped.
  virtual void prepare(std::span<const uint32_t> /*scalars*/, uint64_t /*memory_bytes*/,
                       const Progress& /*progress*/) const {}

  /// What prepare() has to do for these scalars that is not done yet.
  struct Preparation {
    size_t fields = 0;  // that are gathered at once, at the most
    size_t values = 0;  // of each sample that stay on disk, 4 bytes each
    Centring centring = Centring::kNode;
  };
  virtual Preparation preparationFor(std::span<const uint32_t> /*scalars*/) const { return {}; }
  /// Bytes of prepare()'s temporary files at the moment when they were the most.
  virtual uint64_t preparedBytes() const { return 0; }
};

}  // namespace curvisplat
