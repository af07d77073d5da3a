// Reads a mesh in chunks, one ahead, and decides for all of conversion which of its points and cells are
// blanked: by the file, by `--blank VALUE`, or because a number is not finite. Points and cells are numbered
// through all pieces. Memory: a few chunks. Any thread may read.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/read_ahead.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/progress.h"

namespace curvisplat {

/// Points or cells [first, first + count) of a piece; `number`: of the first of them in the whole mesh.
struct MeshRange {
  uint32_t piece = 0;
  uint64_t first = 0, count = 0, number = 0;
};

/// A chunk of points, or of cells, with the number of those that were blanked here.
struct LoadedPoints {
  MeshRange range;
  MeshPoints points;
  BlankCounts blanked;
};
/// MeshCells::hidden of a solid cell that a reader has blanked by its value.
inline constexpr uint8_t kHasNoValue = 2;
struct LoadedCells {
  MeshRange range;
  MeshCells cells;
  BlankCounts blanked;
};

/// The memory of a chunk of cells.
uint64_t bytesOf(const MeshCells& cells);

/// Any number of threads may read concurrently.
class MeshReader {
 public:
  /// `scalars`: indices into source.description().scalars. `source` must outlive the reader. Throws Error if
  /// node-centred and cell-centred scalars are mixed.
  MeshReader(const MeshSource& source, std::vector<uint32_t> scalars, std::optional<double> blank_value);

  /// MeshSource::prepare() of the reader's scalars.
  void prepare(uint64_t memory_bytes, const Progress& progress) const {
    source_->prepare(scalars_, memory_bytes, progress);
  }

  const MeshSource& source() const { return *source_; }
  const std::vector<MeshPiece>& pieces() const { return source_->description().pieces; }
  size_t scalars() const { return scalars_.size(); }
  /// The scalars' indices in the description.
  const std::vector<uint32_t>& scalarIndices() const { return scalars_; }
  Centring centring() const { return centring_; }
  uint64_t points() const { return points_; }
  uint64_t cells() const { return cells_; }

  /// Calls use() for all points, in order, some at a time, one chunk read ahead. A blanked point has an x
  /// that is NaN. Scalars are read where they are node-centred. Throws Error if the file is damaged.
  void forEachPoints(const std::function<void(const LoadedPoints&)>& use) const;
  /// Points of the whole mesh by number.
  void readPoints(uint64_t first, uint64_t count, const std::function<void(const LoadedPoints&)>& use) const;

  /// Calls use() for all cells, or those of `ranges`, in order, one chunk read ahead. A blanked cell, and
  /// one that is not drawn, is kNone. Scalars are read where they are cell-centred.
  void forEachCells(const std::function<void(const LoadedCells&)>& use) const;
  void forEachCells(const std::vector<MeshRange>& ranges,
                    const std::function<void(const LoadedCells&)>& use) const;
  /// Reads cells until use() returns false.
  void forEachCellsWhile(const std::vector<MeshRange>& ranges,
                         const std::function<bool(const LoadedCells&)>& use) const;
  /// Reads all cells: bytes of the largest chunk. Most of them where cells are polyhedra.
  uint64_t largestChunk() const;
  /// The chunks in which all cells are read.
  std::vector<MeshRange> cellRanges() const;

 private:
  void load(const MeshRange& range, LoadedPoints& out) const;
  void load(const MeshRange& range, LoadedCells& out) const;
  std::vector<MeshRange> pointRanges(uint64_t first, uint64_t count) const;
  template <typename Loaded>
  void forEachWhile(const std::vector<MeshRange>& ranges,
                    const std::function<bool(const Loaded&)>& use) const;

  const MeshSource* source_;
  std::vector<uint32_t> scalars_;
  std::optional<double> blank_value_;
  Centring centring_;
  uint64_t points_ = 0, cells_ = 0;
};

}  // namespace curvisplat
