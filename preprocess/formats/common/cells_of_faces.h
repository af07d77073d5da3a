// Polyhedra of formats that list faces: the points of each face, and the faces of each cell, or the cells on the two
// sides of each face. Nothing grows with the mesh but what is on disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "preprocess/formats/common/spool_file.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Faces of a mesh as two arrays.
struct FaceLists {
  using Read = std::function<void(uint64_t first, std::span<uint64_t> to)>;
  Read begins;  // where each face begins among the points, and the end of the last
  Read points;
  uint64_t faces = 0, point_count = 0;
};

/// The faces of each cell: faces[begins[cell], begins[cell + 1]).
struct CellFaces {
  SpooledNumbers begins, faces;
  uint64_t cells = 0;
};

/// Calls its argument with (face, cell) for each side of each face, always in the same order.
using ForEachSide = std::function<void(const std::function<void(uint64_t face, uint64_t cell)>&)>;

/// Sorts faces by cell, with a pass over all sides for each 500,000 cells. `cells`: more than any cell's number.
CellFaces sortFacesByCell(uint64_t cells, const ForEachSide& for_each_side, const ListSpools& spools);

/// The chunk of cells that follow one another whose faces are faces[begins[n] - begins[0], ...).
struct CellChunk {
  std::span<const uint64_t> begins, faces;  // begins: of each cell, and the end of the last
  std::string file;                         // for messages
  uint64_t first = 0;                       // number of the first cell, for messages
};

/// Appends the cells. Faces that lie close together are read together. Throws Error if a face does not exist, or if a
/// cell is not a polyhedron.
void appendCellsOfFaces(const FaceLists& lists, const CellChunk& chunk, MeshCells& out);

}  // namespace curvisplat
