#include "preprocess/formats/vtk/vtk_mesh_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/cells_of_faces.h"
#include "preprocess/formats/vtk/vtk_fields.h"
#include "preprocess/mesh/curved_cells.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Groups of VTK's cell types, by what they become as cells of MeshSource.
enum class VtkCellGroup : uint8_t {
  kLinear,
  kCurved,    // quadratic, Lagrange, Bezier
  kNotSolid,  // vertices, lines, faces
  kUnknown,
};

constexpr uint8_t kVtkPolyhedron = 42, kVtkLagrangeHexahedron = 72, kVtkLagrangePyramid = 74,
                  kVtkBezierTetrahedron = 78, kVtkBezierPyramid = 81;

/// The solid that has the type's corners; kNone: another, or none.
CellKind kindOf(uint8_t type) {
  switch (type) {
    case 10:  // VTK_TETRA
    case 24:  // VTK_QUADRATIC_TETRA
    case 71:  // VTK_LAGRANGE_TETRAHEDRON
    case 78:  // VTK_BEZIER_TETRAHEDRON
      return CellKind::kTetrahedron;
    case 14:  // VTK_PYRAMID
    case 27:  // VTK_QUADRATIC_PYRAMID
    case 37:  // VTK_TRIQUADRATIC_PYRAMID
    case 74:  // VTK_LAGRANGE_PYRAMID
    case 81:  // VTK_BEZIER_PYRAMID
      return CellKind::kPyramid;
    case 13:  // VTK_WEDGE
    case 26:  // VTK_QUADRATIC_WEDGE
    case 31:  // VTK_QUADRATIC_LINEAR_WEDGE
    case 32:  // VTK_BIQUADRATIC_QUADRATIC_WEDGE
    case 73:  // VTK_LAGRANGE_WEDGE
    case 80:  // VTK_BEZIER_WEDGE
      return CellKind::kWedge;
    case 12:  // VTK_HEXAHEDRON
    case 25:  // VTK_QUADRATIC_HEXAHEDRON
    case 29:  // VTK_TRIQUADRATIC_HEXAHEDRON
    case 33:  // VTK_BIQUADRATIC_QUADRATIC_HEXAHEDRON
    case 72:  // VTK_LAGRANGE_HEXAHEDRON
    case 79:  // VTK_BEZIER_HEXAHEDRON
      return CellKind::kHexahedron;
    default:
      return CellKind::kNone;
  }
}

/// A prism over a polygon of `sides`; further points are left out.
void appendPrism(size_t sides, std::span<const uint64_t> points, MeshCells& out) {
  if (points.size() < 2 * sides) return out.append(CellKind::kNone, {});
  out.appendPrism(points.first(2 * sides));
}

VtkCellGroup groupOf(uint8_t type) {
  if ((type >= 10 && type <= 16) || type == kVtkPolyhedron) return VtkCellGroup::kLinear;
  if (kindOf(type) != CellKind::kNone) return VtkCellGroup::kCurved;
  if (type <= 9 || (type >= 21 && type <= 36) || type == 41 || (type >= 51 && type <= 56) ||
      (type >= 60 && type <= 70) || (type >= 75 && type <= 77))
    return VtkCellGroup::kNotSolid;
  return VtkCellGroup::kUnknown;
}

/// The curve of a cell by its number of nodes and, of hexahedra and wedges, by its HigherOrderDegrees.
CellCurve curveOfCell(uint8_t type, size_t nodes, std::span<const double> degrees) {
  const CellKind shape = kindOf(type);
  const bool bezier = type >= kVtkBezierTetrahedron;
  if (degrees.size() == 3 && type >= kVtkLagrangeHexahedron && shape != CellKind::kTetrahedron &&
      std::all_of(degrees.begin(), degrees.end(), [](double n) { return n >= 1 && n <= kMaxCurveOrder; })) {
    CellCurve curve{static_cast<uint8_t>(degrees[0]), static_cast<uint8_t>(degrees[2])};
    if (degrees[1] != degrees[0]) curve.rows = static_cast<uint8_t>(degrees[1]);
    curve.bezier = bezier;
    const bool fits = shape == CellKind::kHexahedron || curve.rows == 0;
    if (fits && nodesOf(shape, curve).size() == nodes) return curve;
  }
  CellCurve curve = curveOf(shape, nodes);
  if (bezier && !curve.complete) return {};
  curve.bezier = bezier;
  return curve;
}

/// Appends a cell of any type but kVtkPolyhedron; kNone if it has fewer points than its type needs. `older`: two edges of
/// Lagrange's hexahedra are in each other's place, as before VTK 9.1. `degrees`: the cell's HigherOrderDegrees; may be empty.
void appendVtkCell(uint8_t type, std::span<const uint64_t> points, bool older,
                   std::span<const double> degrees, MeshCells& out) {
  constexpr uint8_t kVoxel = 11, kPentagonalPrism = 15, kHexagonalPrism = 16;
  if (type == kVoxel && points.size() >= 8) {
    const std::array<uint64_t, 8> round{points[0], points[1], points[3], points[2],
                                        points[4], points[5], points[7], points[6]};
    return out.append(CellKind::kHexahedron, round);
  }
  if (type == kPentagonalPrism) return appendPrism(5, points, out);
  if (type == kHexagonalPrism) return appendPrism(6, points, out);
  if (groupOf(type) != VtkCellGroup::kCurved) return out.append(kindOf(type), points);
  // VTK has no order of nodes for pyramids of Lagrange and Bezier.
  if (type == kVtkLagrangePyramid || type == kVtkBezierPyramid)
    return out.appendCurved(kindOf(type), CellCurve{}, points);
  if (type < kVtkLagrangeHexahedron) return appendCurved(kindOf(type), points, out);
  if (points.size() <= cornersOf(kindOf(type))) return out.append(kindOf(type), points);
  const CellCurve curve = curveOfCell(type, points.size(), degrees);
  if (type != kVtkLagrangeHexahedron || !older) return out.appendCurved(kindOf(type), curve, points);
  std::vector<uint64_t> nodes(points.begin(), points.end());
  const size_t along = curve.layers;
  if (curve.rows == 0 && curve.layers == curve.order && along > 1) {
    const auto edge = nodes.begin() + static_cast<ptrdiff_t>(8 + 10 * (along - 1));
    std::rotate(edge, edge + static_cast<ptrdiff_t>(along - 1),
                edge + static_cast<ptrdiff_t>(2 * (along - 1)));
  }
  out.appendCurved(CellKind::kHexahedron, curve, nodes);
}

// Bits of vtkGhostType (vtkDataSetAttributes). Another piece has a duplicate cell; a duplicate point may
// well be one of a cell that no other piece has.
constexpr int kOmittedPoint = 2;
constexpr int kDuplicateCell = 1;
constexpr int kOmittedCell = kDuplicateCell | 8 | 32;  // refined, hidden

constexpr uint64_t kChunk = 65536;
constexpr uint64_t kMaxPoints = uint64_t{1} << 24;  // of cells that are read together
// Numbers of points are read as doubles, which hold them up to this.
constexpr double kLargestInteger = 0x1p53;

std::vector<float> readAsFloats(const VtkArray& array, uint64_t first, uint64_t count) {
  std::vector<float> numbers(count);
  const WantedComponent<float> wanted{0, numbers.data()};
  readTuples<float>(array, first, count, std::span(&wanted, 1));
  return numbers;
}

void readGhosts(const std::optional<VtkArray>& array, uint64_t first, uint64_t count, int bits,
                std::vector<uint8_t>& out) {
  out.assign(count, 0);
  if (!array) return;
  const std::vector<float> flags = readAsFloats(*array, first, count);
  for (size_t n = 0; n < count; ++n) out[n] = (static_cast<int>(flags[n]) & bits) != 0;
}

/// The cells that vtkGhostType or vtkGhostLevels leaves out.
void readHiddenCells(const VtkPiece& piece, uint64_t first, uint64_t count, int bits,
                     std::vector<uint8_t>& out) {
  readGhosts(piece.cell_ghosts, first, count, bits, out);
  if (piece.cell_ghosts || !piece.cell_levels) return;
  const std::vector<float> levels = readAsFloats(*piece.cell_levels, first, count);
  for (size_t n = 0; n < count; ++n) out[n] = levels[n] > 0;
}

/// The HigherOrderDegrees of some cells, three each; empty if the piece has none. (Floats would have FloatOffset subtracted.)
std::vector<double> readDegrees(const VtkPiece& piece, uint64_t first, uint64_t count) {
  const auto found = std::find_if(piece.cell_data.begin(), piece.cell_data.end(), [](const VtkArray& array) {
    return array.name == "HigherOrderDegrees" && array.components == 3;
  });
  if (found == piece.cell_data.end()) return {};
  std::vector<double> degrees(3 * count), along(count);
  for (int axis = 0; axis < 3; ++axis) {
    const WantedComponent<double> wanted{axis, along.data()};
    readTuples<double>(*found, first, count, std::span(&wanted, 1));
    for (size_t n = 0; n < count; ++n) degrees[3 * n + static_cast<size_t>(axis)] = along[n];
  }
  return degrees;
}

/// Places where each of some cells begins, and the end of the last, in an array of `length`.
std::vector<uint64_t> beginsOf(const VtkArray& ends, uint64_t first, uint64_t count, uint64_t length,
                               const MeshPiece& piece) {
  std::vector<uint64_t> begins;
  readIntegers(ends, first - (first > 0), count + (first > 0), begins);
  if (first == 0) begins.insert(begins.begin(), 0);
  for (size_t n = 0; n < count; ++n)
    if (begins[n + 1] < begins[n] || begins[n + 1] > length)
      throw Error("{}: cell {} ends at place {} of the connectivity; expected {} to {}; the file is damaged",
                  piece.file, first + n, static_cast<int64_t>(begins[n + 1]), begins[n], length);
  return begins;
}

/// Cells [first, first + count), all of them polyhedra.
void appendPolyhedra(const VtkSharedFaces& shared, uint64_t first, uint64_t count, const MeshPiece& piece,
                     MeshCells& out) {
  const std::vector<uint64_t> begins = beginsOf(shared.cell_ends, first, count, shared.faces.tuples, piece);
  std::vector<uint64_t> faces;
  readIntegers(shared.faces, begins.front(), begins.back() - begins.front(), faces);
  const auto read = [](const VtkArray& array) {
    return [&array](uint64_t from, std::span<uint64_t> to) {
      std::vector<uint64_t> values;
      readIntegers(array, from, to.size(), values);
      std::copy(values.begin(), values.end(), to.begin());
    };
  };
  const auto face_begins = [&](uint64_t from, std::span<uint64_t> to) {
    if (from > 0) return read(shared.ends)(from - 1, to);
    to[0] = 0;
    read(shared.ends)(0, to.subspan(1));
  };
  appendCellsOfFaces({face_begins, read(shared.points), shared.ends.tuples, shared.points.tuples},
                     {begins, faces, piece.file, first}, out);
}

}  // namespace

void readIntegers(const VtkArray& array, uint64_t first, uint64_t count, std::vector<uint64_t>& out) {
  std::vector<double> values(count);
  const WantedComponent<double> wanted{0, values.data()};
  readTuples<double>(array, first, count, std::span(&wanted, 1));
  out.resize(count);
  for (size_t n = 0; n < count; ++n)
    out[n] = values[n] >= 0 && values[n] <= kLargestInteger ? static_cast<uint64_t>(values[n])
                                                            : std::numeric_limits<uint64_t>::max();
}

uint64_t largestOf(const VtkArray& array) {
  uint64_t largest = 0;
  std::vector<uint64_t> values;
  for (uint64_t first = 0; first < array.tuples; first += kChunk) {
    readIntegers(array, first, std::min(kChunk, array.tuples - first), values);
    for (const uint64_t value : values)
      if (value != std::numeric_limits<uint64_t>::max()) largest = std::max(largest, value);
  }
  return largest;
}

VtkMeshSource::VtkMeshSource(VtkMesh mesh) : mesh_(std::move(mesh)) {
  describeFiles(mesh_, description_);
  description_.pieces = mesh_.names;
  description_.coordinate_bytes = 4;
  std::vector<size_t> pieces;
  for (size_t n = 0; n < mesh_.pieces.size(); ++n) {
    pieces.push_back(n);
    if (bytesOf(std::get<VtkPoints>(mesh_.pieces[n].nodes).type) == 8) description_.coordinate_bytes = 8;
  }
  checkTypes();
  warnOfCopies();
  fields_.describe(mesh_.pieces, pieces, description_);
}

/// One of several pieces, opened alone: the cells that it shares with others are missing then.
void VtkMeshSource::warnOfCopies() {
  const VtkPiece& piece = mesh_.pieces.front();
  if (mesh_.pieces.size() > 1 || !(piece.cell_ghosts || piece.cell_levels)) return;
  const uint64_t cells = mesh_.cells.front().types.tuples;
  uint64_t copies = 0;
  std::vector<uint8_t> flags;
  for (uint64_t first = 0; first < cells; first += kChunk) {
    readHiddenCells(piece, first, std::min(kChunk, cells - first), kDuplicateCell, flags);
    copies += static_cast<uint64_t>(std::count(flags.begin(), flags.end(), 1));
  }
  if (copies > 0)
    description_.warnings.push_back(fmt::format(
        "left out: {} of {} cells, which {} marks as copies of other pieces'; the file that names "
        "all pieces (.pvtu) draws them",
        copies, cells, piece.cell_ghosts ? "vtkGhostType" : "vtkGhostLevels"));
}

void VtkMeshSource::checkTypes() {
  std::array<uint64_t, 256> counts{};
  for (size_t piece = 0; piece < mesh_.cells.size(); ++piece) {
    const VtkArray& types = mesh_.cells[piece].types;
    std::vector<uint64_t> values;
    for (uint64_t first = 0; first < types.tuples; first += kChunk) {
      readIntegers(types, first, std::min(kChunk, types.tuples - first), values);
      for (size_t n = 0; n < values.size(); ++n) {
        if (values[n] > 255 || groupOf(static_cast<uint8_t>(values[n])) == VtkCellGroup::kUnknown)
          throw Error("{}: cell {} has type {}, which is not one of VTK's types of cells",
                      mesh_.names[piece].file, first + n, static_cast<int64_t>(values[n]));
        ++counts[values[n]];
      }
    }
  }
  std::array<uint64_t, 4> groups{};
  for (size_t type = 0; type < counts.size(); ++type)
    groups[static_cast<size_t>(groupOf(static_cast<uint8_t>(type)))] += counts[type];
  const auto of = [&](VtkCellGroup group) { return groups[static_cast<size_t>(group)]; };
  const uint64_t solid = of(VtkCellGroup::kLinear) + of(VtkCellGroup::kCurved);
  if (solid == 0)
    throw Error(
        "{}: has no solid cell ({} vertices, lines or faces); expected tetrahedra, hexahedra or others",
        mesh_.files.empty() ? "" : mesh_.files.front(), of(VtkCellGroup::kNotSolid));
  has_curved_cells_ = of(VtkCellGroup::kCurved) > 0;
  if (of(VtkCellGroup::kNotSolid) > 0)
    description_.warnings.push_back(
        fmt::format("{} cells are vertices, lines or faces and are left out", of(VtkCellGroup::kNotSolid)));
}

void VtkMeshSource::readScalars(uint32_t piece, uint64_t first, uint64_t count,
                                std::span<const uint32_t> scalars,
                                std::vector<std::vector<float>>& out) const {
  out.resize(scalars.size());
  for (std::vector<float>& values : out) values.resize(count);
  fields_.forEachWanted(scalars, out,
                        [&](const VtkFields::Field& field, std::span<const WantedComponent<float>> wanted) {
                          if (const VtkArray* const array = VtkFields::arrayOf(field, mesh_.pieces, piece))
                            return readTuples<float>(*array, first, count, wanted);
                          for (const WantedComponent<float>& component : wanted)
                            std::fill_n(component.to, count, std::numeric_limits<float>::quiet_NaN());
                        });
}

void VtkMeshSource::readPoints(uint32_t piece_number, uint64_t first, uint64_t count,
                               std::span<const uint32_t> scalars, MeshPoints& out) const {
  const VtkPiece& piece = mesh_.pieces.at(piece_number);
  for (std::vector<double>* const axis : {&out.x, &out.y, &out.z}) axis->resize(count);
  const std::array<WantedComponent<double>, 3> wanted{
      {{0, out.x.data()}, {1, out.y.data()}, {2, out.z.data()}}};
  readTuples<double>(std::get<VtkPoints>(piece.nodes), first, count, wanted);
  readGhosts(piece.point_ghosts, first, count, kOmittedPoint, out.hidden);
  readScalars(piece_number, first, count, scalars, out.scalars);
}

void VtkMeshSource::readCells(uint32_t piece_number, uint64_t first, uint64_t count,
                              std::span<const uint32_t> scalars, MeshCells& out) const {
  const VtkCells& cells = mesh_.cells.at(piece_number);
  const MeshPiece& piece = mesh_.names[piece_number];
  out.clear();
  std::vector<uint64_t> types, points, faces;
  readIntegers(cells.types, first, count, types);
  const std::vector<uint64_t> begins = beginsOf(cells.ends, first, count, cells.connectivity.tuples, piece);
  if (begins.back() - begins.front() > kMaxPoints)
    throw Error("{}: cells {} to {} have {} points; expected at most {}; the file is damaged", piece.file,
                first, first + count - 1, begins.back() - begins.front(), kMaxPoints);
  readIntegers(cells.connectivity, begins.front(), begins.back() - begins.front(), points);
  const std::vector<double> degrees = readDegrees(mesh_.pieces[piece_number], first, count);
  std::vector<uint64_t> face_ends;
  if (cells.face_ends) readIntegers(*cells.face_ends, first, count, face_ends);
  // The faces of a polyhedron begin where those of the one before it end.
  uint64_t face_begin = 0;
  for (uint64_t back = first; back > 0 && face_begin == 0 && !face_ends.empty();) {
    const uint64_t from = back - std::min(back, kChunk);
    std::vector<uint64_t> before;
    readIntegers(*cells.face_ends, from, back - from, before);
    for (const uint64_t end : before)
      if (end != std::numeric_limits<uint64_t>::max()) face_begin = end;
    back = from;
  }

  for (size_t n = 0; n < count; ++n) {
    auto of_cell =
        std::span<const uint64_t>(points).subspan(begins[n] - begins.front(), begins[n + 1] - begins[n]);
    if (cells.counted && !of_cell.empty()) of_cell = of_cell.subspan(1);
    if (types[n] != kVtkPolyhedron) {
      appendVtkCell(static_cast<uint8_t>(types[n]), of_cell, cells.older_edges,
                    std::span(degrees).subspan(3 * (degrees.empty() ? 0 : n), degrees.empty() ? 0 : 3), out);
      if (out.shapes.back() == CellKind::kNone &&
          groupOf(static_cast<uint8_t>(types[n])) != VtkCellGroup::kNotSolid)
        throw Error("{}: cell {} of type {} has {} points, too few; the file is damaged", piece.file,
                    first + n, types[n], of_cell.size());
      continue;
    }
    if (cells.shared_faces) {
      size_t end = n + 1;
      while (end < count && types[end] == kVtkPolyhedron) ++end;
      appendPolyhedra(*cells.shared_faces, first + n, end - n, piece, out);
      n = end - 1;
      continue;
    }
    if (!cells.faces_inline) {
      const bool known = n < face_ends.size() && face_ends[n] != std::numeric_limits<uint64_t>::max();
      if (!known || face_ends[n] <= face_begin || face_ends[n] > cells.faces->tuples)
        throw Error("{}: polyhedron {} has no faces; the file is damaged", piece.file, first + n);
      readIntegers(*cells.faces, face_begin, face_ends[n] - face_begin, faces);
      face_begin = face_ends[n];
      of_cell = faces;
    }
    if (of_cell.empty() || !out.appendPolyhedron(of_cell[0], of_cell.subspan(1)))
      throw Error("{}: polyhedron {} has faces that do not add up; the file is damaged", piece.file,
                  first + n);
  }
  readHiddenCells(mesh_.pieces[piece_number], first, count, kOmittedCell, out.hidden);
  readScalars(piece_number, first, count, scalars, out.scalars);
}

}  // namespace curvisplat
