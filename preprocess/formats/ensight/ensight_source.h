// EnSight Gold cases: unstructured parts as the pieces of a mesh, structured parts as the blocks of a grid.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// Structured parts where there are any, or unstructured ones. Scalars: variable NAME; vectors NAME:mag,
/// NAME:x, NAME:y, NAME:z. Throws Error.
std::unique_ptr<DataSource> openEnsight(const OpenGridOptions& options);

}  // namespace curvisplat
