// The layout of a PLOT3D file: the properties in which two files with the same contents can differ, and
// their description in words; the payload of a file, which hides Fortran's record markers; and the header.
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
//
// A header is read under an assumed layout (plot3d_fit.h tries all); memory grows with the number of blocks
// and records alone. One thread reads the header; then any number of threads may read the payload.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/open_grid_options.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {

enum class Plot3dKind { kGrid, kQ, kOverflow, kFunction };

/// The layout of an ASCII file describes its spool file (spoolAscii()): all numbers, integers too, are
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

/// The records do not match the assumed layout. Not fatal: another layout may fit.
class RecordMismatch : public Error {
 public:
  using Error::Error;
};

/// A Fortran file without its record markers: one contiguous range of payload bytes, read by position.
///
///   file      | m | record 1 | m | m | record 2, part 1 | m | m | record 2, part 2 | m |   m: 4 or 8 bytes
///   payload       | record 1 |       | record 2 ................................. |
///
/// gfortran and ifort split a record of more than 2^31 - 9 bytes into subrecords. A negative leading marker
/// means that the record continues in the next subrecord; a negative trailing marker, that this subrecord
/// continues the previous one. The sizes are read from the markers. 8-byte markers need no subrecords.
///
/// Needs a few bytes per (sub)record. One thread appends the records; then any number of threads may read.
class PayloadFile {
 public:
  /// Reads all `size` bytes as payload if there are no markers; with markers the payload is empty until
  /// nextRecord().
  PayloadFile(std::shared_ptr<const InputFile> file, uint64_t size, RecordMarkers records, ByteOrder order);

  /// Skips the next record, checks the markers of each of its subrecords, and appends it to the payload.
  /// Returns its size in bytes. Throws RecordMismatch if markers differ or point beyond the end of the file.
  uint64_t nextRecord();

  const InputFile& file() const { return *file_; }
  /// Size of the payload in bytes.
  uint64_t size() const { return size_; }
  /// Bytes of the file after the payload and its last marker.
  uint64_t bytesBehind() const { return file_size_ - end_in_file_; }
  /// Position in the file of a byte of the payload; for size(): of the first byte after the last marker.
  uint64_t offsetInFile(uint64_t offset) const;

  /// Throws Error if the payload ends before `offset` + to.size(), or if reading fails.
  void readAt(uint64_t offset, std::span<std::byte> to) const;

 private:
  int64_t markerAt(uint64_t offset) const;

  struct Segment {
    uint64_t offset = 0;  // in the payload
    uint64_t offset_in_file = 0;
  };

  std::shared_ptr<const InputFile> file_;
  uint64_t file_size_;
  RecordMarkers records_;
  ByteOrder order_;
  uint64_t size_ = 0;
  uint64_t end_in_file_ = 0;
  std::vector<Segment> segments_;  // ascending
};

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

/// The header of a file under an assumed layout.
struct Plot3dHeader {
  std::vector<Plot3dBlock> blocks;  // without offsets
  uint32_t components = 3;          // grid 3 (2-D: 2), Q 5 (2-D: 4), OVERFLOW and function: from the header
  uint32_t species = 0;             // OVERFLOW files only
  uint64_t bytes = 0;               // size of the header in the payload
};

/// Reads the header. Ignores the precision and blanking of `layout`. Records that are read are appended to
/// `payload`. All blocks together must have at most `file_size` nodes. Throws LayoutMisfit or
/// RecordMismatch; Error if reading fails.
Plot3dHeader readPlot3dHeader(PayloadFile& payload, const Plot3dLayout& layout, uint64_t file_size);

}  // namespace curvisplat
