// MeshSource, the interface that readers of unstructured grids offer to conversion: points and cells of one
// or more pieces, read in chunks by any number of threads. It is the unstructured counterpart of
// GridSource. No source holds a whole mesh in memory.
//
// Cells refer to points by their number in the piece. Pieces may repeat one another's points (partitions
// do), and elements each other's (discontinuous ones do): such points are one point (PointNumbers,
// preprocess/gather/point_numbers.h). Cells come in any mix of shapes:
//
//      tetrahedron    pyramid        wedge          hexahedron
//           3            4             5               7-----6
//          /|\          /|\           /|\             /|    /|
//         / | \        / | \         3-+-4           4-----5 |
//        0--+--2      3--+--2        | 2 |           | 3---|-2
//         \ | /       | /   /        |/ \|           |/    |/
//           1         0----1         0---1           0-----1
//
// A polyhedron has its corners and, for each face, the places of its corners among them. Corners and faces
// may go round either way: only volumes without sign are taken of them. A cell with repeated corners is
// degenerate and allowed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/base/progress.h"

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

/// The polynomial of a cell of higher order, by its nodes in VTK's order of Lagrange cells (curved_cells.h).
struct CellCurve {
  uint8_t order = 0;     // 0: not known; the cell is drawn by its corners
  uint8_t layers = 0;    // the order along the third axis
  bool complete = true;  // false: nodes at the corners and the middles of the edges alone
};

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
  // The cells of higher order, which have all their nodes as corners: the cell, and its polynomial. Only from
  // readers of files: what follows them sees linear cells (cutCurved(),
  // preprocess/formats/common/cut_source.h).
  std::vector<std::pair<size_t, CellCurve>> curved;
  std::vector<float>
      volumes;  // [cell] of parts of curved cells; 0: that of the linear cell. Empty: of all cells

  size_t size() const { return shapes.size(); }
  std::span<const uint64_t> cornersOfCell(size_t n) const {
    return std::span(corners).subspan(corner_begin[n], corner_begin[n + 1] - corner_begin[n]);
  }
  std::span<const uint32_t> facesOfCell(size_t n) const {
    return std::span(faces).subspan(face_begin[n], face_begin[n + 1] - face_begin[n]);
  }

  void clear();
  /// A cell of any shape but kPolyhedron; further corners are left out.
  void append(CellKind shape, std::span<const uint64_t> of_cell);
  /// A cell of higher order, with all its nodes; of order 0 with its corners alone.
  void appendCurved(CellKind shape, CellCurve curve, std::span<const uint64_t> nodes);
  /// Cell n of others; of a curved one the corners. Neither its scalars nor whether it is hidden.
  void appendOf(const MeshCells& others, size_t n);
  /// A prism over a polygon: the points of its bottom, then those of its top. kNone with fewer than 6 or an
  /// odd number.
  void appendPrism(std::span<const uint64_t> points);
  /// A polyhedron: of each face the number of its points and the points themselves, `count` faces in all.
  /// Returns false, and appends a cell of kNone, if `stream` is not exactly that.
  bool appendPolyhedron(uint64_t count, std::span<const uint64_t> stream);
};

/// The faces of a cell, by places among its corners, in the form of MeshCells::faces; `own`: those of a
/// polyhedron.
std::span<const uint32_t> facesOf(CellKind shape, std::span<const uint32_t> own);

/// Throws Error, which names the piece's file and the cell, if one refers to a point that does not exist.
/// `first`: the number of the first of them.
void checkCells(const MeshCells& cells, const MeshPiece& piece, uint64_t first);

/// Points of one piece. The source resizes the arrays, which keep their capacity.
struct MeshPoints {
  std::vector<double> x, y, z;              // world units
  std::vector<uint8_t> hidden;              // 1: blanked by the file; always filled
  std::vector<std::vector<float>> scalars;  // [requested scalar][point]
};

/// An unstructured grid, read by ranges of points and cells of a piece.
class MeshSource : public DataSource {
 public:
  /// Points [first, first + count) of a piece, and the node-centred scalars with the given indices in
  /// description().scalars. Any number of threads may read concurrently. Throws Error with the file.
  virtual void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                          MeshPoints& out) const = 0;

  /// Cells [first, first + count) of a piece, and cell-centred scalars. Numbers of points are as stored:
  /// checkCells() refuses those that do not exist.
  virtual void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                         MeshCells& out) const = 0;

  /// Whether some of its cells are curved (MeshCells::curved).
  virtual bool hasCurvedCells() const { return false; }

  /// Computes those of these scalars that depend on the whole mesh, within `memory_bytes`. Call it in one
  /// thread before they are read; further calls are allowed. Throws Interrupted once `progress` is stopped.
  virtual void prepare(std::span<const uint32_t> /*scalars*/, uint64_t /*memory_bytes*/,
                       const Progress& /*progress*/) const {}

  /// The work that prepare() still has to do for these scalars.
  struct Preparation {
    size_t fields = 0;  // gathered at once, at most
    size_t values = 0;  // of each sample that stay on disk, 4 bytes each
    Centring centring = Centring::kNode;
  };
  virtual Preparation preparationFor(std::span<const uint32_t> /*scalars*/) const { return {}; }
  /// Bytes of prepare()'s temporary files at the moment when they were the most.
  virtual uint64_t preparedBytes() const { return 0; }
};

}  // namespace curvisplat
