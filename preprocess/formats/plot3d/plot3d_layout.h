// The layout of a PLOT3D file: the properties in which two files with the same contents can differ, and their
// description in words.
//
//   kind       header                            per block
//   ---------  --------------------------------  -----------------------------------------------
//   grid       [blocks] {ni nj nk}...            x...  y...  z...  [iblank...]
//   Q          [blocks] {ni nj nk}...            mach alpha re time | 5 components
//   OVERFLOW   [blocks] {ni nj nk}... nq nqc     15 or more parameters (plot3d_file.cpp) | nq components
//   function   [blocks] {ni nj nk nvar}...       nvar components
//
// [blocks], the block count, is absent from single-block files; {...}... repeats for each block. i is
// fastest. In Fortran files the block count, the dimensions of all blocks, the parameters of a block and the
// values of a block are one record each. Only the "whole" format is read; the rarer "planes" format has a
// record for each k.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_order.h"
#include "preprocess/formats/common/open_grid_options.h"

namespace curvisplat {

enum class Plot3dKind { kGrid, kQ, kOverflow, kFunction };

/// The layout of an ASCII file describes its spool file (ascii_spool.h): all numbers, integers too, are
/// doubles in the machine's byte order, without records.
struct Plot3dLayout {
  Plot3dKind kind = Plot3dKind::kGrid;
  bool ascii = false;
  ByteOrder byte_order = ByteOrder::kLittle;
  RecordMarkers records = RecordMarkers::kNone;
  int precision_bytes = 4;
  bool multi_block = false;
  bool blanking = false;         // grids only
  bool two_dimensional = false;  // neither nk nor z; recognised in order to be refused

  uint64_t integerBytes() const { return ascii ? 8 : 4; }
};

struct Plot3dBlock {
  uint64_t ni = 0, nj = 0, nk = 0;
  uint64_t values_offset = 0;  // position of the block's first value in the payload
  uint64_t nodes() const { return ni * nj * nk; }
};

/// "grid", "Q solution", "OVERFLOW Q solution", "function file".
std::string describe(Plot3dKind kind);
/// "big-endian, C (no record markers), single precision, single-block, no iblank", in the words of the
/// options that set the layout.
std::string describe(const Plot3dLayout& layout);
/// "1 block of 40x32x32"; "12 blocks (8x12x12, 8x12x12, 4x4x4, ...)".
std::string describe(const std::vector<Plot3dBlock>& blocks);

}  // namespace curvisplat
