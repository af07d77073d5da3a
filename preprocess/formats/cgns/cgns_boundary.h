// The nodes of a boundary condition of a CGNS zone.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// `details`: the children of the BC_t node; `nodes`: the zone's size. Nothing for what is not a part of one of the
/// zone's faces: lists of points, and ranges that do not fit. The name and the type are not set. Throws Error if
/// the file cannot be read.
std::optional<GridBoundary> cgnsBoundary(const CgnsFile& file, const std::vector<CgnsNode>& details,
                                         const std::array<uint64_t, 3>& nodes);

}  // namespace curvisplat
