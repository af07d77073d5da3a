// The MeshSource of all VTK formats, and the input of it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "preprocess/formats/vtk/vtk_fields.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Faces that polyhedra share, and the faces of each cell: faces[end of n - 1, end of n), as points[...] of a face.
struct VtkSharedFaces {
  VtkArray ends, points;
  VtkArray cell_ends, faces;
};

/// The cells of a piece. The points of cell n are connectivity[end of n - 1, end of n).
struct VtkCells {
  uint64_t cells = 0;
  VtkArray types;  // uint8
  VtkArray ends;   // one a cell
  VtkArray connectivity;
  std::optional<VtkArray> faces;      // of polyhedra: of each the number of its faces; of these their points
  std::optional<VtkArray> face_ends;  // one a cell; -1 of others
  std::optional<VtkSharedFaces> shared_faces;  // in place of these two
  bool counted = false;                        // legacy: the points of a cell follow their number
  bool older_edges = false;                    // of Lagrange's hexahedra: as before VTK 9.1
  bool faces_inline = false;                   // legacy: the points of a polyhedron are its faces
};

/// A piece with polylines: those of polygonal data, or all cells of an unstructured grid, which have types.
struct VtkLines {
  VtkPiece piece;
  VtkCells cells;
  uint64_t first_cell = 0;  // among the tuples of the cells' arrays
};

/// Pieces have points in VtkPiece::nodes, and no extent.
struct VtkMesh {
  std::string format;
  std::vector<std::string> files;
  std::vector<VtkPiece> pieces;
  std::vector<VtkCells> cells;   // [piece]
  std::vector<MeshPiece> names;  // [piece]
  std::vector<double> times;
  uint32_t time_step = 0;
  std::vector<std::string> warnings;
};

/// Scalars: vtk_fields.h. A cell is left out if vtkGhostType says that it is a duplicate, refined or hidden,
/// and a point's cells if it says that the point is hidden.
class VtkMeshSource final : public MeshSource {
 public:
  /// Looks at the types of all cells. Throws Error if none is solid, or if one is of an unknown type.
  explicit VtkMeshSource(VtkMesh mesh);

  const GridDescription& description() const override { return description_; }
  bool hasCurvedCells() const override { return has_curved_cells_; }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override;
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override;

 private:
  void checkTypes();
  void warnOfCopies();
  void readScalars(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                   std::vector<std::vector<float>>& out) const;

  VtkMesh mesh_;
  GridDescription description_;
  VtkFields fields_;
  bool has_curved_cells_ = false;
};

/// The integers of an array; negative ones and those that are none become the largest.
void readIntegers(const VtkArray& array, uint64_t first, uint64_t count, std::vector<uint64_t>& out);

/// The largest value of an array, negative ones left out: how long the array that it counts through has to
/// be.
uint64_t largestOf(const VtkArray& array);

}  // namespace curvisplat
