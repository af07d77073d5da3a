// Gives each cell the positions and values of its corners. Cells refer to points by number, and the points of a
// mesh need not fit in memory:
//
// Cells mostly refer to points near those of the cell before: then the pages of points that were used last are in memory,
// and others are read when a cell has them (point_pages.h). Where cells refer to points all over the mesh:
//
//    cells --(point, slot)--> streams by ranges of points --+ points of a range --(slot, position, values)-->
//                                                                     streams by groups of cells --> cells
//
// A slot is the place of a corner among those of all cells, in order. What comes out is the same.
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

/// Cells with their corners. Only those that are drawn. As many as have kMaxCorners corners, and places of faces,
/// together; a single cell may have more.
struct GatheredCells {
  std::vector<uint64_t> numbers;        // [cell] in the whole mesh
  std::vector<CellKind> shapes;         // [cell]
  std::vector<size_t> corner_begin{0};  // [cell + 1], in the arrays of corners
  std::vector<uint64_t> corners;        // PointNumbers' numbers; positions and values are of the file's point
  std::vector<glm::dvec3> at;           // [corner]
  std::vector<float> corner_values;     // [corner * fields + field], of node-centred scalars
  std::vector<size_t> face_begin{0};    // [cell + 1], in faces
  std::vector<uint32_t> faces;          // as MeshCells'
  std::vector<float> cell_values;       // [cell * fields + field], of cell-centred scalars
  std::vector<float> volumes;           // [cell]: MeshCells'; empty: of all 0

  static constexpr size_t kMaxCorners = size_t{1} << 17;

  size_t size() const { return shapes.size(); }
  /// The volume of a part of a curved cell; 0: that of the linear cell.
  float volumeOf(size_t n) const { return volumes.empty() ? 0.0f : volumes[n]; }
  CellView view(size_t n, size_t corner_fields) const;
  /// Whether the four cells from n on come before `end`, and have one shape that isTakenAtOnce().
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

/// How the memory of a pass over a mesh is shared: two chunks of cells (one is read ahead; of polyhedra they are
/// seven times as large as of hexahedra), and of the rest a half each for the corners and for what is made of them.
uint64_t halfBesideChunks(uint64_t memory_bytes, uint64_t chunk_bytes);

class CornerGather {
 public:
  /// Reads the cells and the points unless the latter fit. Keeps to `memory_bytes` besides a few chunks. All
  /// references must outlive it.
  CornerGather(const MeshReader& reader, const PointNumbers& numbers, uint64_t memory_bytes,
               ScratchFiles scratch, Progress& progress);

  /// Calls `use` for all cells, in order, some at a time; in any thread, while the next ones are gathered. A cell with a
  /// blanked corner is left out. Once.
  void forEach(const std::function<void(const GatheredCells&)>& use);

 private:
  /// Cells whose corners are in memory together.
  struct Group {
    std::vector<MeshRange> ranges;
    uint64_t first_slot = 0, slots = 0;
  };

  class UsedBeside;
  /// Leaves in `ranges` those of the cells that are left for streams.
  void gatherByPages(std::vector<MeshRange>& ranges, UsedBeside& used);
  void gatherByStreams(const std::vector<MeshRange>& of_cells, UsedBeside& used);
  /// Overwrites `out` with what is drawn of the cells from `begin` on, as many as go together, with the file's numbers of
  /// points, without positions and values. Returns the first of the others.
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
