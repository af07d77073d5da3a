// The metadata of a CGNS file's structured or unstructured zones: scalars, and the arrays that they are read from.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/cgns/cgns_tree.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The arrays of a scalar on a zone: one, or three for the magnitude of a vector. Empty: the scalar is NaN. They are
/// the tree's.
using CgnsArrays = std::vector<const CgnsArray*>;

/// The zone's name, with its base's where there are several.
std::string cgnsZoneName(const CgnsTree& tree, size_t zone);

/// Files, format, times, warnings and notes.
void describeCgns(const CgnsFile& file, const CgnsTree& tree, uint32_t time_step,
                  GridDescription& description);

/// Adds the scalars to the description, and warnings of zones without them. Returns [scalar][zone].
std::vector<std::vector<CgnsArrays>> describeCgnsScalars(const CgnsTree& tree, GridDescription& description);

}  // namespace curvisplat
