// Cells of an unstructured grid, as readers give them and as splats are made of them: any mix of shapes.
//
//      tetrahedron    pyramid        wedge          hexahedron
//           3            4             5               7-----6
//          /|\          /|\           /|\             /|    /|
//         / | \        / | \         3-+-4           4-----5 |
//        0--+--2      3--+--2        | 2 |           | 3---|-2
//         \ | /       | /   /        |/ \|           |/    |/
//           1         0----1         0---1           0-----1
//
// A polyhedron has its corners and, for each face, the places of its corners among them. Corners and faces may
// go round either way: only volumes without sign are taken of them. A cell with repeated corners is degenerate
// and allowed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

enum class CellKind : uint8_t {
  kNone,  // not drawn: a vertex, a line, a face
  kTetrahedron,
  kPyramid,
  kWedge,
  kHexahedron,
  kPolyhedron,
};

/// Corners of a shape; 0 for kNone and kPolyhedron.
size_t cornersOf(CellKind shape);

/// Cells that follow one another in a piece. Readers begin with clear() and append.
struct MeshCells {
  std::vector<CellKind> shapes;
  std::vector<size_t> corner_begin{0};  // [cell + 1], in corners
  std::vector<uint64_t> corners;        // points, by their number in the piece
  std::vector<size_t> face_begin{0};    // [cell + 1], in faces
  std::vector<uint32_t> faces;          // of a polyhedron: of each face the number of its corners, and their
                                        // places among the cell's corners
  std::vector<uint8_t> hidden;          // 1: blanked by the file, or another piece's
  std::vector<std::vector<float>> scalars;  // [requested scalar][cell]

  size_t size() const { return shapes.size(); }
  std::span<const uint64_t> cornersOfCell(size_t n) const {
    return std::span(corners).subspan(corner_begin[n], corner_begin[n + 1] - corner_begin[n]);
  }
  std::span<const uint32_t> facesOfCell(size_t n) const {
    return std::span(faces).subspan(face_begin[n], face_begin[n + 1] - face_begin[n]);
  }

  void clear();
  /// A cell of any shape but kPolyhedron; further corners (of quadratic cells) are left out.
  void append(CellKind shape, std::span<const uint64_t> of_cell);
  /// A prism over a polygon: the points of its bottom, then those of its top. kNone with fewer than 6 or an odd number.
  void appendPrism(std::span<const uint64_t> points);
  /// A polyhedron: of each face the number of its points and the points themselves, `count` faces in all. Returns
  /// false, and appends a cell of kNone, if `stream` is not exactly that.
  bool appendPolyhedron(uint64_t count, std::span<const uint64_t> stream);
};

/// The faces of a cell, by places among its corners, in the form of MeshCells::faces; `own`: those of a
/// polyhedron.
std::span<const uint32_t> facesOf(CellKind shape, std::span<const uint32_t> own);

/// Throws Error, which names the piece's file and the cell, if one refers to a point that does not exist.
/// `first`: the number of the first of them.
void checkCells(const MeshCells& cells, const MeshPiece& piece, uint64_t first);

}  // namespace curvisplat
