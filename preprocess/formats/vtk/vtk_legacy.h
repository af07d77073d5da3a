// Legacy VTK files (.vtk): structured, rectilinear, uniform and unstructured grids, ASCII and binary.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/formats/vtk/vtk_mesh_source.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether the file has the signature of a legacy VTK file.
bool isVtkLegacy(const InputFile& file);

/// Numbers in text are spooled to a temporary file first. Throws Error.
std::unique_ptr<DataSource> openVtkLegacy(const OpenGridOptions& options);

/// The lines of polygonal data or an unstructured grid. Throws Error.
VtkLines readVtkLegacyLines(const VtkFiles& files, const std::filesystem::path& path);

}  // namespace curvisplat
