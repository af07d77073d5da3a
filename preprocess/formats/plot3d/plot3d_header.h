// The header of a PLOT3D file under an assumed layout: blocks and their dimensions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/formats/plot3d/payload_file.h"
#include "preprocess/formats/plot3d/plot3d_layout.h"

namespace curvisplat {

/// Thrown to end the attempt at one layout, and how far it got. Never leaves plot3d_fit.
struct LayoutMisfit {
  enum Reached {
    nothing,         // not even the first record, or the block count
    first_record,    // a header, with impossible dimensions
    dimensions,      // possible dimensions, but the sizes are others
    known_structure  // recognised as something else
  };
  Reached reached;
  std::string reason;
};

struct Plot3dHeader {
  std::vector<Plot3dBlock> blocks;  // without offsets
  uint32_t components = 3;          // grid 3, Q 5, OVERFLOW and function files their own; 2-D: 2 and 4
  uint32_t species = 0;             // of an OVERFLOW file
  uint64_t bytes = 0;               // of the payload
};

/// Precision and blanking of `layout` don't matter. With records, they are appended to `payload`. All blocks
/// together have at most `file_size` nodes. Throws LayoutMisfit and RecordMismatch; Error if the disk fails.
Plot3dHeader readPlot3dHeader(PayloadFile& payload, const Plot3dLayout& layout, uint64_t file_size);

}  // namespace curvisplat
