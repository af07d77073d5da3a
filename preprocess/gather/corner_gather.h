// CornerGather gives each cell the positions and values of its corners. Cells refer to points by number, and
// the points of a mesh need not fit in memory. Most cells refer to points near those of the cell before: then
// the pages of points that were used last stay in memory, and others are read when a cell needs them
// (point_pages.h). Where cells refer to points all over the mesh:
//
//    cells --(point, slot)--> streams by ranges of points --+ points of a range --(slot, position, values)-->
//                                                                     streams by groups of cells --> cells
//
// A slot is the number of a corner, counted through all cells in order. Both ways give the same result.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "preprocess/gather/mesh_reader.h"
#include "preprocess/gather/point_numbers.h"
#include "preprocess/moments/cell_moments.h"
#include "stream/base/temporary_files.h"

namespace curvisplat {

/// A batch of cells with their corners, without those that are not drawn. A cell with a blanked corner is
/// there as kNone, and takes part in nothing. A batch has at most kMaxCorners corners and as many elements in
/// `faces`, but a single cell may have more.
struct GatheredCells {
  std::vector<uint64_t> numbers;        // [cell] in the whole mesh
  std::vector<CellKind> shapes;         // [cell]
  std::vector<size_t> corner_begin{0};  // [cell + 1], in the arrays of corners
  std::vector<uint64_t> corners;        // numbers by PointNumbers; `at` and values are the file's point's
  std::vector<glm::dvec3> at;           // [corner]
  std::vector<float> corner_values;     // [corner * fields + field], of node-centred scalars
  std::vector<size_t> face_begin{0};    // [cell + 1], in faces
  std::vector<uint32_t> faces;          // as MeshCells::faces
  std::vector<float> cell_values;       // [cell * fields + field], of cell-centred scalars
  std::vector<float> volumes;           // [cell], as MeshCells::volumes; empty: 0 for all cells

  static constexpr size_t kMaxCorners = size_t{1} << 17;

  size_t size() const { return shapes.size(); }
  /// The volume of a part of a curved cell; 0: that of the linear cell.
  float volumeOf(size_t n) const { return volumes.empty() ? 0.0f : volumes[n]; }
  CellView view(size_t n, size_t corner_fields) const;
  /// Whether cells n to n + 3 lie before `end` and have the same shape, one that isTakenAtOnce().
  bool areFourAlike(size_t n, size_t end, size_t corner_fields) const;
  std::array<CellView, kCellsAtOnce> viewsOfFour(size_t n, size_t corner_fields) const;
  std::span<const uint64_t> cornersOfCell(size_t n) const {
    return std::span(corners).subspan(corner_begin[n], corner_begin[n + 1] - corner_begin[n]);
  }
  std::span<const uint32_t> facesOfPolyhedron(size_t n) const {
    return std::span(faces).subspan(face_begin[n], face_begin[n + 1] - face_begin[n]);
  }
  void clear();
};

/// The memory for corners in a pass over a mesh, and as much again for what is made of them: half of what two
/// chunks of cells leave (one is read ahead), which count as half of `memory_bytes` at most. `chunk_bytes`:
/// of the largest chunk; those of polyhedra are seven times as large as those of hexahedra.
uint64_t halfBesideChunks(uint64_t memory_bytes, uint64_t chunk_bytes);

class CornerGather {
 public:
  /// Reads nothing yet. forEach() keeps to `memory_bytes` besides a few chunks of cells. All references must
  /// outlive the CornerGather.
  CornerGather(const MeshReader& reader, const PointNumbers& numbers, uint64_t memory_bytes,
               ScratchFiles scratch, Progress& progress);

  /// Calls `use` for all cells, in order, a batch at a time. The calls follow one another, each on any
  /// thread, while the next batch is gathered. A cell with a blanked corner comes as kNone. Call it once.
  /// Throws what `use` throws, Error if a file or the disk fails, and Interrupted once the progress is
  /// stopped.
  void forEach(const std::function<void(const GatheredCells&)>& use);

 private:
  /// Cells whose corners are in memory together.
  struct Group {
    std::vector<MeshRange> ranges;
    uint64_t first_slot = 0, slots = 0;
  };

  class UsedBeside;
  /// Gathers cells by pages as long as that pays, and leaves in `ranges` the cells that remain for streams.
  void gatherByPages(std::vector<MeshRange>& ranges, UsedBeside& used);
  void gatherByStreams(const std::vector<MeshRange>& of_cells, UsedBeside& used);
  /// Overwrites `out` with a batch of the drawn ones of the cells from `begin` on, without positions and
  /// values. Points have the file's numbers, counted through all pieces. Returns the index of the first cell
  /// left.
  size_t gather(const LoadedCells& loaded, size_t begin, GatheredCells& out) const;
  static void dropIfBlanked(GatheredCells& cells, size_t n);

  const MeshReader* reader_;
  const PointNumbers* numbers_;
  const uint64_t memory_bytes_;
  const ScratchFiles scratch_;
  Progress* progress_;
  const size_t corner_fields_, cell_fields_;
};

}  // namespace curvisplat
