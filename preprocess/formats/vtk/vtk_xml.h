// VTK's XML formats: .vts, .vtr, .vti and .vtu, their parallel forms .pvts, .pvtr, .pvti and .pvtu,
// collections (.vtm, .vtpd, .vtpc), AMR sets (.vth, .vthb) and time series of any of these (.pvd).
#pragma once

#include <memory>
#include <string_view>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/vtk/vtk_mesh_source.h"
#include "preprocess/formats/vtk/vtk_xml_file.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The pieces of a .vts, .vtr or .vti file.
struct VtkXmlPieces {
  std::vector<VtkPiece> pieces;
  std::string encoding;        // of the first array
  std::optional<double> time;  // from its field data
};

/// Whether readXmlPieces() supports files of this type.
bool hasXmlPieces(std::string_view type);
/// Throws Error if the file is damaged.
VtkXmlPieces readXmlPieces(const VtkXmlFile& file, std::vector<std::string>& warnings);

/// The pieces of a .vtu file.
struct VtkXmlMeshPieces {
  std::vector<VtkPiece> pieces;
  std::vector<VtkCells> cells;
  std::string encoding;
  std::optional<double> time;
};

/// Whether readXmlMeshPieces() supports files of this type.
bool hasXmlMeshPieces(std::string_view type);
/// Pieces without cells are left out. Throws Error if the file is damaged.
VtkXmlMeshPieces readXmlMeshPieces(const VtkXmlFile& file, std::vector<std::string>& warnings);

/// The pieces of a .vtp or .vtu file with their lines. Throws Error if it is neither, or damaged.
std::vector<VtkLines> readXmlLines(const VtkXmlFile& file);

/// Opens a file of any of these formats, at one time step. In a collection structured grids come first:
/// unstructured ones are drawn where there is no other. Throws Error.
std::unique_ptr<DataSource> openVtkXml(const OpenGridOptions& options);

}  // namespace curvisplat
