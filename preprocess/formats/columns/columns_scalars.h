// Chooses the scalars of columns (columns_layout.h) that are on the same layers, whose heights are known.
#pragma once

#include <string>
#include <vector>

#include "preprocess/formats/columns/columns_layout.h"
#include "preprocess/formats/netcdf/netcdf_files.h"

namespace curvisplat {

/// The group with the scalar that `wanted` names first, or the largest. Throws Error if there is none.
ColumnsScalars chooseColumnsScalars(const NetcdfFiles& file, const ColumnsMap& map,
                                    const std::vector<std::string>& wanted,
                                    std::vector<std::string>& warnings);

}  // namespace curvisplat
