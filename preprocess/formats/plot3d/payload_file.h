// A file without its Fortran record markers: one run of payload bytes, read by position.
//
//   file      | m | payload of record 1 | m | m | subrecord | m | m | subrecord | m |     m: 4 or 8 bytes
//   payload       | record 1 .......... |       | record 2 ............. |
//
// gfortran and ifort cut a record of more than 2^31 - 9 bytes into subrecords: a negative leading marker says
// "goes on in the next one", a negative trailing marker "is the continuation of the one before". Their sizes
// are taken from the file. 8-byte markers need no subrecords.
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

/// The records do not chain as assumed. No failure yet: another layout may fit.
class RecordMismatch : public Error {
 public:
  using Error::Error;
};

/// Costs a few bytes a (sub)record. Records are appended by one thread; then any number of threads may read.
class PayloadFile {
 public:
  /// Without markers all of `size` bytes are payload; with markers there is none until nextRecord().
  PayloadFile(std::shared_ptr<const InputFile> file, uint64_t size, RecordMarkers records, ByteOrder order);

  /// Hops over the next record, checks both markers of each of its parts, and appends it to the payload.
  /// Returns its bytes. Throws RecordMismatch where the markers differ or lead out of the file.
  uint64_t nextRecord();

  const InputFile& file() const { return *file_; }
  /// Bytes of payload.
  uint64_t size() const { return size_; }
  /// Bytes of the file behind the payload and its markers.
  uint64_t bytesBehind() const { return file_size_ - end_in_file_; }
  /// Where a byte of the payload lies in the file; of size(): where the bytes behind begin.
  uint64_t offsetInFile(uint64_t offset) const;

  /// Throws Error if the payload ends before `offset` + to.size(), or the disk fails.
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
