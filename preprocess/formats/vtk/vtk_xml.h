// VTK's XML formats of structured grids: .vts, .vtr and .vti, their parallel forms .pvts, .pvtr and .pvti,
// collections (.vtm, .vtpd, .vtpc) and time series of any of these (.pvd).
#pragma once

#include <memory>
#include <string_view>

#include "preprocess/formats/common/open_grid_options.h"
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

/// Opens a file of any of these formats, at one time step. Throws Error.
std::unique_ptr<GridSource> openVtkXml(const OpenGridOptions& options);

}  // namespace curvisplat
