// How a PLOT3D file lies on disk: what can differ between two files with the same contents, and in words.
//
//   grid       [blocks] dims(ni nj nk) x blocks, then per block   x... y... z... [iblank...]
//   Q          [blocks] dims(ni nj nk) x blocks, then per block   mach alpha re time | 5 components
//   OVERFLOW   [blocks] dims(ni nj nk) x blocks nq nqc, then per block   15 or more parameters | nq
//   components function   [blocks] dims(ni nj nk nvar) x blocks, then per block   nvar components
//
// i is fastest. Fortran writes each of: the block count, all dims, the four conditions, a block's values, as
// one record. "Whole" format only: the rarer "planes" format has a record for each k.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_order.h"
#include "preprocess/formats/common/open_grid_options.h"

namespace curvisplat {

enum class Plot3dKind { kGrid, kQ, kOverflow, kFunction };

/// An ASCII file's layout is that of its spool (ascii_spool.h): numbers and integers are doubles in the
/// machine's byte order, without records.
struct Plot3dLayout {
  Plot3dKind kind = Plot3dKind::kGrid;
  bool ascii = false;
  ByteOrder byte_order = ByteOrder::kLittle;
  RecordMarkers records = RecordMarkers::kNone;
  int precision_bytes = 4;
  bool multi_block = false;
  bool blanking = false;         // grids only
  bool two_dimensional = false;  // no nk, no z: recognised, not read

  uint64_t integerBytes() const { return ascii ? 8 : 4; }
};

struct Plot3dBlock {
  uint64_t ni = 0, nj = 0, nk = 0;
  uint64_t values_offset = 0;  // of the block's first value, in the payload
  uint64_t nodes() const { return ni * nj * nk; }
};

/// "grid", "Q solution", "OVERFLOW Q solution", "function file".
std::string describe(Plot3dKind kind);
/// "big-endian, C (no record markers), single precision, one block, no iblank"; the options that force it use
/// the same words.
std::string describe(const Plot3dLayout& layout);
/// "1 block of 40x32x32"; "12 blocks (8x12x12, 8x12x12, 4x4x4, ...)".
std::string describe(const std::vector<Plot3dBlock>& blocks);

}  // namespace curvisplat
