// VTKHDF (.vtkhdf, .hdf, .h5): VTK's grids in HDF5, versions 1 and 2.
//
//   /VTKHDF        Type: ImageData, UnstructuredGrid (in parts), OverlappingAMR (Level0, Level1, ...), or
//                  MultiBlockDataSet or PartitionedDataSetCollection: groups that are such data sets
//     Assembly     of the last two: a tree of links to these groups, which gives their names
//     Steps        times, and where each step begins in the arrays; in a set in each of its groups
//
// Memory grows with the number of parts of the open step, not with their numbers.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether it is an HDF5 file with a group VTKHDF.
bool isVtkHdf(const InputFile& file);

/// Opens one time step. In a set structured grids come first: unstructured ones are drawn where there is no other. Throws
/// Error.
std::unique_ptr<DataSource> openVtkHdf(const OpenGridOptions& options);

}  // namespace curvisplat
