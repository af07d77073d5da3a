// The header of a PLOT3D file under an assumed layout: blocks and their dimensions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/formats/plot3d/payload_file.h"
#include "preprocess/formats/plot3d/plot3d_layout.h"

namespace curvisplat {

/// Thrown to end the attempt with one layout; records how far it got. Never leaves plot3d_fit.
struct LayoutMisfit {
  enum Reached {
    kNothing,        // neither the first record nor the block count is valid
    kFirstRecord,    // a header with impossible dimensions
    kDimensions,     // possible dimensions, but the sizes differ
    kKnownStructure  // recognised as a structure that is not read
  };
  Reached reached;
  std::string reason;
};

struct Plot3dHeader {
  std::vector<Plot3dBlock> blocks;  // without offsets
  uint32_t components = 3;          // grid 3 (2-D: 2), Q 5 (2-D: 4), OVERFLOW and function: from the header
  uint32_t species = 0;             // OVERFLOW files only
  uint64_t bytes = 0;               // size of the header in the payload
};

/// Ignores the precision and blanking of `layout`. Records that are read are appended to `payload`. All
/// blocks together must have at most `file_size` nodes. Throws LayoutMisfit or RecordMismatch; Error if
/// reading fails.
Plot3dHeader readPlot3dHeader(PayloadFile& payload, const Plot3dLayout& layout, uint64_t file_size);

}  // namespace curvisplat
