// The nodes of a grid's faces, in a temporary file: read from the grid in one pass, and then as often as levels of
// detail need them.
//
// Scalars of cell-centred data are those of the layer of cells behind the face: a node has the mean of the
// cells around it.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "preprocess/coincidence/abutting_faces.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "stream/base/mutex.h"
#include "stream/base/progress.h"
#include "stream/base/temporary_files.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

/// A range of the nodes of a row.
struct RowRange {
  uint64_t begin = 0, end = UINT64_MAX;  // end above the row's: to its end
};

/// A row of nodes of a face, or a range of it.
struct LatticeRow {
  static constexpr uint32_t kNone = 0xffffffff;  // as the first code: there is no such node

  std::vector<std::array<uint32_t, 3>> codes;  // steps of the FaceBox
  std::vector<std::vector<float>> scalars;     // [scalar][node]; anything where there is no node
};

/// Calls `use` with ranges of `count` nodes, one after the other: long rows are read in parts.
template <typename Use>
void forRowParts(uint64_t count, const Use& use) {
  constexpr uint64_t kNodesAtATime = 1 << 16;
  for (uint64_t begin = 0; begin < count; begin += kNodesAtATime)
    use(RowRange{begin, begin + kNodesAtATime < count ? begin + kNodesAtATime : count});
}

/// The faces of a block, out of faces in the order of their blocks. A grid may have 100,000 blocks.
std::span<const GridFace> facesOfBlock(std::span<const GridFace> faces, uint32_t block);

class BlankFaces;

class FaceSpool {
 public:
  /// `faces`: their lattices.
  FaceSpool(const NodeReader& reader, std::vector<GridFace> faces, const FaceBox& box,
            const std::filesystem::path& folder);
  FaceSpool(const FaceSpool&) = delete;
  FaceSpool& operator=(const FaceSpool&) = delete;

  /// Reads the grid, and adds the faces of its cells at blocks' ends to `abutting`, and those of blanked cells to `blanks`
  /// if that is not null.
  void fill(const SlabBuffers& buffers, AbuttingFaces& abutting, BlankFaces* blanks, Progress& progress);

  std::span<const GridFace> faces() const { return faces_; }
  const FaceBox& box() const { return box_; }
  size_t scalars() const { return reader_.scalars(); }
  /// The nodes of a row along u, after fill(). Any thread.
  LatticeRow row(size_t face, uint64_t v, const RowRange& range = {}) const;
  /// Every `stride`-th node of the range, from its first on, and its last.
  LatticeRow thinnedRow(size_t face, uint64_t v, const RowRange& range, uint32_t stride) const;
  /// Whether the cells behind a range of the quads of a row exist. For cell-centred data only; otherwise
  /// nodes decide.
  std::vector<uint8_t> cellsOfRow(size_t face, uint64_t v, const RowRange& quads) const;
  bool ofCells() const { return reader_.centring() == Centring::kCell; }

 private:
  struct Place {
    uint64_t positions, scalars;  // offsets of the face's arrays
  };
  void store(const LoadedSlab& loaded, size_t face);
  void addEnds(const LoadedSlab& loaded, AbuttingFaces& abutting) const;
  void addEndsIn(const LoadedSlab& loaded, const NodeBox& box, AbuttingFaces& abutting, Mutex& adding) const;
  std::vector<float> storedScalars(size_t face, uint64_t v, const RowRange& range) const;

  const NodeReader& reader_;
  const std::vector<GridFace> faces_;
  const FaceBox box_;
  std::vector<Place> places_;  // [face]
  NamelessFile file_;
};

}  // namespace curvisplat
