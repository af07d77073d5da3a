#include <fmt/format.h>

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

void addArrays(const VtkXmlFile& file, const Node& data, bool of_cells, VtkPiece& piece,
               std::vector<std::string>& warnings) {
  const uint64_t tuples = of_cells ? piece.extent.cells() : piece.extent.nodes();
  const auto leaveOut = [&](const Node& node) {
    warnings.push_back(fmt::format("left out: array {} of the {} has type {}, which is not drawn",
                                   node.attribute("Name").value(), of_cells ? "cells" : "points",
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

}  // namespace

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
    addArrays(file, node.child("PointData"), false, piece, warnings);
    addArrays(file, node.child("CellData"), true, piece, warnings);
    read.pieces.push_back(std::move(piece));
  }
  const Node any_array =
      file.content().find_node([](const Node& node) { return std::string_view(node.name()) == "DataArray"; });
  read.encoding = file.encoding(any_array);
  read.time = timeOf(file);
  return read;
}

}  // namespace curvisplat
