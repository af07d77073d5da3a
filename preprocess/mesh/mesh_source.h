// MeshSource, the interface that readers of unstructured grids offer to conversion: points and cells of one
// or more pieces, read in chunks by any number of threads. It is the unstructured counterpart of
// GridSource. No source holds a whole mesh in memory.
//
// Cells refer to points by their number in the piece. Pieces may repeat points of other pieces, as partitions
// do, and elements those of other elements, as discontinuous elements do. Points that are repeated count as
// one (PointNumbers, preprocess/gather/point_numbers.h). Cells come in any mix of shapes:
//
//      tetrahedron    pyramid        wedge          hexahedron
//           3            4             5               7-----6
//          /|\          /|\           /|\             /|    /|
//         / | \        / | \         3-+-4           4-----5 |
//        0--+--2      3--+--2        | 2 |           | 3---|-2
//         \ | /       | /   /        |/ \|           |/    |/
//           1         0----1         0---1           0-----1
//
// A polyhedron has a list of its corners and, for each face, the indices of the face's corners in that list.
// Corners may be listed in either sense of rotation: only absolute values of volumes are used. A cell with
// repeated corners is degenerate, and allowed.
#pragma once

#include <compare>
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

/// The number of corners of a shape; 0 for kNone and kPolyhedron.
size_t cornersOf(CellKind shape);

/// The order of the polynomial of a curved cell. Its nodes are in VTK's order for Lagrange cells
/// (curved_cells.h).
struct CellCurve {
  uint8_t order = 0;     // 0: not known; the cell is drawn by its corners
  uint8_t layers = 0;    // the order along the third axis
  bool complete = true;  // false: nodes at the corners and the middles of the edges alone
  uint8_t rows = 0;      // the order along the second axis of a hexahedron; 0: as along the first
  bool bezier = false;   // its nodes are control points, of which only the corners lie on it (bezier_cells.h)

  auto operator<=>(const CellCurve&) const = default;
};

/// Cells that follow one another in a piece. Readers begin with clear() and append.
struct MeshCells {
  std::vector<CellKind> shapes;
  std::vector<size_t> corner_begin{0};  // [cell + 1], in corners
  std::vector<uint64_t> corners;        // points, by their number in the piece
  std::vector<size_t> face_begin{0};    // [cell + 1], in faces
  std::vector<uint32_t> faces;          // for each face of a polyhedron the number of its corners, then their
                                        // indices among the cell's corners
  std::vector<uint8_t> hidden;          // [cell] 1: blanked by the file, or drawn by another piece
  std::vector<std::vector<float>> scalars;  // [requested scalar][cell]
  // The index and the polynomial of each cell of higher order; its `corners` are all its nodes. Only readers
  // of files fill this: cutCurved() (preprocess/formats/common/cut_source.h) makes linear cells of them,
  // which is what all later stages see.
  std::vector<std::pair<size_t, CellCurve>> curved;
  std::vector<float>
      volumes;  // [cell] of a part of a curved cell; 0: as the linear cell's. Empty: 0 for all cells

  size_t size() const { return shapes.size(); }
  std::span<const uint64_t> cornersOfCell(size_t n) const {
    return std::span(corners).subspan(corner_begin[n], corner_begin[n + 1] - corner_begin[n]);
  }
  std::span<const uint32_t> facesOfCell(size_t n) const {
    return std::span(faces).subspan(face_begin[n], face_begin[n + 1] - face_begin[n]);
  }

  /// Removes all cells. `scalars` stay as they are.
  void clear();
  /// Appends a cell of any shape but kPolyhedron. Points beyond the shape's corners are left out; if there
  /// are too few, the cell is kNone.
  void append(CellKind shape, std::span<const uint64_t> of_cell);
  /// Appends a cell of higher order. `nodes`: all its nodes, the corners first. If curve.order is 0, only the
  /// corners are kept.
  void appendCurved(CellKind shape, CellCurve curve, std::span<const uint64_t> nodes);
  /// Appends cell n of `others`, only with its corners if it is curved. Copies neither its scalars nor
  /// `hidden`.
  void appendOf(const MeshCells& others, size_t n);
  /// Appends a prism over a polygon. `points`: those of its bottom, then those of its top in the same order.
  /// Fewer than 6 or an odd number of points make a cell of kNone.
  void appendPrism(std::span<const uint64_t> points);
  /// Appends a polyhedron of `count` faces. `stream`: for each face the number of its points, then the
  /// points. Returns false, and appends a cell of kNone, if `stream` is not exactly that.
  bool appendPolyhedron(uint64_t count, std::span<const uint64_t> stream);
};

/// The faces of a cell, in the form of MeshCells::faces. `own`: facesOfCell() of the cell, which is the
/// result for a polyhedron.
std::span<const uint32_t> facesOf(CellKind shape, std::span<const uint32_t> own);

/// Whether each edge of a polyhedron is one of two of its faces, `faces` as facesOfCell() gives them: its volume has a border all round.
bool isClosed(std::span<const uint32_t> faces);

/// Throws Error, which names the piece's file and the cell, if a cell refers to a point that does not exist.
/// `first`: the number in the piece of the first of `cells`, for the message.
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
  /// Reads points [first, first + count) of a piece, and the node-centred scalars with the given indices in
  /// description().scalars. Any number of threads may read concurrently. Throws Error with the file.
  virtual void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                          MeshPoints& out) const = 0;

  /// Reads cells [first, first + count) of a piece, and cell-centred scalars. The numbers of points are as
  /// stored: checkCells() refuses those that do not exist. Threads and errors are as for readPoints().
  virtual void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                         MeshCells& out) const = 0;

  /// Whether some of its cells are curved (MeshCells::curved).
  virtual bool hasCurvedCells() const { return false; }

  /// Computes those of `scalars` that depend on the whole mesh, within `memory_bytes`. Call it in one thread
  /// before they are read; repeated calls are allowed. Throws Interrupted once `progress` is stopped.
  virtual void prepare(std::span<const uint32_t> /*scalars*/, uint64_t /*memory_bytes*/,
                       const Progress& /*progress*/) const {}

  /// The work that prepare() still has to do for these scalars.
  struct Preparation {
    size_t fields = 0;  // the most scalars that are gathered at once
    size_t values = 0;  // numbers of 4 bytes that stay on disk for each sample
    Centring centring = Centring::kNode;
  };
  virtual Preparation preparationFor(std::span<const uint32_t> /*scalars*/) const { return {}; }
  /// The most bytes that prepare()'s temporary files have taken at a time.
  virtual uint64_t preparedBytes() const { return 0; }
};

}  // namespace curvisplat
