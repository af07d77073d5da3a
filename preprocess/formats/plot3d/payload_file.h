// A Fortran file without its record markers: one contiguous range of payload bytes, read by position.
//
//   file      | m | record 1 | m | m | record 2, part 1 | m | m | record 2, part 2 | m |     m: 4 or 8 bytes
//   payload       | record 1 |       | record 2 ................................. |
//
// gfortran and ifort split a record of more than 2^31 - 9 bytes into subrecords. A negative leading marker
// means that the record continues in the next subrecord; a negative trailing marker, that this subrecord
// continues the previous one. The sizes are read from the markers. 8-byte markers need no subrecords.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/formats/common/byte_order.h"
#include "preprocess/formats/common/open_grid_options.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {

/// The records do not match the assumed layout. Not fatal: another layout may fit.
class RecordMismatch : public Error {
 public:
  using Error::Error;
};

/// Needs a few bytes per (sub)record. One thread appends the records; then any number of threads may read.
class PayloadFile {
 public:
  /// Without markers all `size` bytes are payload; with markers the payload is empty until nextRecord().
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

}  // namespace curvisplat
