// SU2: its native mesh (su2_mesh.h), with values from restart files. The mesh, and restart files that are text, are spooled when
// they are opened; binary restart files are read by position. Any number of threads may read.
#pragma once

#include <cstdint>
#include <memory>

#include "preprocess/formats/common/open_grid_options.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether the text begins with one of SU2's keys.
bool isSu2(const InputFile& file);
/// The number of zones of such a file, as its first two keys say: 1 without NZONE.
uint64_t su2Zones(const InputFile& file);

/// Zones are pieces. options.solutions: restart files of the one zone; one for each zone, in their order, of which the variables
/// that all have are read; or one for all zones, whose points follow one another, or for one of them. Throws Error.
std::unique_ptr<DataSource> openSu2(const OpenGridOptions& options);

}  // namespace curvisplat
