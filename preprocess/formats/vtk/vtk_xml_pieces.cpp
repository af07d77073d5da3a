#include <fmt/format.h>

#include <cmath>

#include "preprocess/formats/vtk/vtk_xml.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

using Node = pugi::xml_node;

/// The value of an array with one tuple of one component.
double singleValue(const VtkArray& array) {
  double value = 0;
  const WantedComponent<double> wanted{0, &value};
  readTuples<double>(array, 0, 1, std::span(&wanted, 1));
  return value;
}

std::optional<double> timeOf(const VtkXmlFile& file) {
  for (const Node& node : file.content().child("FieldData").children("DataArray"))
    if (std::string(node.attribute("Name").value()) == "TimeValue")
      if (const auto array = file.numericArray(node, 1)) return singleValue(*array);
  return std::nullopt;
}

std::string encodingOf(const VtkXmlFile& file) {
  return file.encoding(file.content().find_node(
      [](const Node& node) { return std::string_view(node.name()) == "DataArray"; }));
}

VtkPoints pointsOf(const VtkXmlFile& file, const Node& piece, uint64_t nodes) {
  const Node node = piece.child("Points").child("DataArray");
  if (!node) file.fail("has a piece without <Points>");
  VtkPoints points = file.array(node, nodes);
  if (points.components != 3)
    file.fail(fmt::format("has points of {} components; expected 3", points.components));
  return points;
}

VtkAxes axesOf(const VtkXmlFile& file, const Node& piece, const VtkExtent& extent) {
  VtkAxes axes;
  Node node = piece.child("Coordinates").child("DataArray");
  for (size_t axis = 0; axis < 3; ++axis, node = node.next_sibling("DataArray")) {
    if (!node) file.fail("has a piece without the three arrays of <Coordinates>");
    axes[axis] = file.array(node, extent.nodesAlong(axis));
    if (axes[axis].components != 1)
      file.fail(fmt::format("has coordinates of {} components; expected 1", axes[axis].components));
  }
  return axes;
}

VtkUniformNodes uniformNodesOf(const VtkXmlFile& file) {
  VtkUniformNodes uniform;
  const Node image = file.content();
  const std::vector<double> origin = file.numbers(image, "Origin", 3);
  const std::vector<double> spacing = file.numbers(image, "Spacing", 3);
  uniform.origin = {origin[0], origin[1], origin[2]};
  uniform.spacing = {spacing[0], spacing[1], spacing[2]};
  if (!image.attribute("Direction")) return uniform;
  const std::vector<double> rows = file.numbers(image, "Direction", 9);
  for (glm::length_t row = 0; row < 3; ++row)
    for (glm::length_t column = 0; column < 3; ++column)
      uniform.direction[column][row] = rows[static_cast<size_t>(3 * row + column)];
  return uniform;
}

struct Owner {
  bool of_cells = false;
  uint64_t tuples = 0;
};

void addArrays(const VtkXmlFile& file, const Node& data, const Owner& owner, VtkPiece& piece,
               std::vector<std::string>& warnings) {
  const auto [of_cells, tuples] = owner;
  const auto leaveOut = [&, cells = of_cells](const Node& node) {
    warnings.push_back(fmt::format("left out: array {} of the {} has type {}, which is not drawn",
                                   node.attribute("Name").value(), cells ? "cells" : "points",
                                   node.attribute("type").value()));
  };
  for (const Node& node : data.children("DataArray"))
    if (auto array = file.numericArray(node, tuples))
      addDataArray(piece, of_cells, std::move(*array), warnings);
    else
      leaveOut(node);
  for (const Node& node : data.children("Array")) leaveOut(node);
  (of_cells ? piece.active_cell_data : piece.active_point_data) = data.attribute("Scalars").value();
}

/// An attribute that counts points or cells.
uint64_t countIn(const VtkXmlFile& file, const Node& piece, const char* attribute) {
  constexpr double kMax = 1e14;
  const double count = file.numbers(piece, attribute, 1)[0];
  if (!(count >= 0) || count > kMax || count != std::trunc(count))
    file.fail(fmt::format("has {} {}; expected a count", attribute, count));
  return static_cast<uint64_t>(count);
}

VtkCells cellArraysOf(const VtkXmlFile& file, const Node& piece, uint64_t count) {
  const auto named = [&](const char* name) {
    return piece.child("Cells").find_child_by_attribute("DataArray", "Name", name);
  };
  const auto required = [&](const char* name) {
    const Node node = named(name);
    if (!node) file.fail(fmt::format("has a piece without {} in its <Cells>", name));
    return node;
  };
  VtkCells cells;
  cells.cells = count;
  cells.older_edges = file.version() < 2.1;
  cells.types = file.array(required("types"), count);
  cells.ends = file.array(required("offsets"), count);
  const uint64_t points = largestOf(cells.ends);
  if (points == 0) file.fail("has cells without points");
  cells.connectivity = file.array(required("connectivity"), points);
  if (named("polyhedron_to_faces")) {  // since VTK 9.4
    const auto list = [&](const char* lists, const VtkArray& ends) {
      return file.array(required(lists), largestOf(ends));
    };
    VtkSharedFaces shared;
    shared.cell_ends = file.array(required("polyhedron_offsets"), count);
    shared.faces = list("polyhedron_to_faces", shared.cell_ends);
    uint64_t faces = 0;
    faces = largestOf(shared.faces) + 1;
    shared.ends = file.array(required("face_offsets"), faces);
    shared.points = list("face_connectivity", shared.ends);
    cells.shared_faces = std::move(shared);
    return cells;
  }
  if (!named("faces") || !named("faceoffsets")) return cells;
  VtkArray ends = file.array(named("faceoffsets"), count);
  const uint64_t faces = largestOf(ends);
  if (faces == 0) return cells;  // no polyhedra
  cells.faces = file.array(named("faces"), faces);
  cells.face_ends = std::move(ends);
  return cells;
}

}  // namespace

bool hasXmlMeshPieces(std::string_view type) {
  return type == "UnstructuredGrid";
}

VtkXmlMeshPieces readXmlMeshPieces(const VtkXmlFile& file, std::vector<std::string>& warnings) {
  VtkXmlMeshPieces read;
  for (const Node& node : file.content().children("Piece")) {
    const uint64_t points = countIn(file, node, "NumberOfPoints"),
                   cells = countIn(file, node, "NumberOfCells");
    if (points == 0 || cells == 0) continue;
    VtkPiece piece;
    piece.nodes = pointsOf(file, node, points);
    addArrays(file, node.child("PointData"), {false, points}, piece, warnings);
    addArrays(file, node.child("CellData"), {true, cells}, piece, warnings);
    read.pieces.push_back(std::move(piece));
    read.cells.push_back(cellArraysOf(file, node, cells));
  }
  read.encoding = encodingOf(file);
  read.time = timeOf(file);
  return read;
}

std::vector<VtkLines> readXmlLines(const VtkXmlFile& file) {
  std::vector<VtkLines> read;
  std::vector<std::string> warnings;  // of arrays that no one asks for
  if (hasXmlMeshPieces(file.type())) {
    VtkXmlMeshPieces mesh = readXmlMeshPieces(file, warnings);
    for (size_t n = 0; n < mesh.pieces.size(); ++n)
      read.push_back({std::move(mesh.pieces[n]), std::move(mesh.cells[n])});
    return read;
  }
  if (file.type() != "PolyData")
    file.fail(
        fmt::format("is a VTK file of type {}; lines and points are in .vtp files (PolyData) and .vtu files "
                    "(UnstructuredGrid)",
                    file.type()));
  for (const Node& node : file.content().children("Piece")) {
    const uint64_t points = countIn(file, node, "NumberOfPoints");
    if (points == 0) continue;
    const auto cellsIn = [&](const char* attribute) {
      return node.attribute(attribute) ? countIn(file, node, attribute) : uint64_t{0};
    };
    VtkLines& lines = read.emplace_back();
    lines.piece.nodes = pointsOf(file, node, points);
    lines.first_cell = cellsIn("NumberOfVerts");
    lines.cells.cells = cellsIn("NumberOfLines");
    addArrays(file, node.child("PointData"), {false, points}, lines.piece, warnings);
    addArrays(
        file, node.child("CellData"),
        {true, lines.first_cell + lines.cells.cells + cellsIn("NumberOfPolys") + cellsIn("NumberOfStrips")},
        lines.piece, warnings);
    if (lines.cells.cells == 0) continue;
    const auto named = [&](const char* name) {
      const Node array = node.child("Lines").find_child_by_attribute("DataArray", "Name", name);
      if (!array) file.fail(fmt::format("has a piece without {} in its <Lines>", name));
      return array;
    };
    lines.cells.ends = file.array(named("offsets"), lines.cells.cells);
    lines.cells.connectivity = file.array(named("connectivity"), largestOf(lines.cells.ends));
  }
  return read;
}

bool hasXmlPieces(std::string_view type) {
  return type == "StructuredGrid" || type == "RectilinearGrid" || type == "ImageData";
}

VtkXmlPieces readXmlPieces(const VtkXmlFile& file, std::vector<std::string>& warnings) {
  VtkXmlPieces read;
  for (const Node& node : file.content().children("Piece")) {
    const std::optional<VtkExtent> extent = file.extent(node, "Extent");
    if (!extent) continue;
    VtkPiece piece;
    piece.extent = *extent;
    if (file.type() == "StructuredGrid")
      piece.nodes = pointsOf(file, node, extent->nodes());
    else if (file.type() == "RectilinearGrid")
      piece.nodes = axesOf(file, node, *extent);
    else
      piece.nodes = uniformNodesOf(file);
    addArrays(file, node.child("PointData"), {false, extent->nodes()}, piece, warnings);
    addArrays(file, node.child("CellData"), {true, extent->cells()}, piece, warnings);
    read.pieces.push_back(std::move(piece));
  }
  read.encoding = encodingOf(file);
  read.time = timeOf(file);
  return read;
}

}  // namespace curvisplat
