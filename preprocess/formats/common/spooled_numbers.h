// A list of numbers of 8 bytes in a spool file.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "preprocess/formats/common/spool_file.h"

namespace curvisplat {

struct SpooledNumbers {
  std::shared_ptr<SpoolFile> spool;
  uint64_t offset = 0, count = 0;  // of numbers

  /// Any number of threads. The list must hold numbers of the type that is read.
  void read(uint64_t first, std::span<double> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
  void read(uint64_t first, std::span<uint64_t> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
  void read(uint64_t first, std::span<int64_t> to) const {
    if (!to.empty()) spool->readAt(offset + 8 * first, std::as_writable_bytes(to));
  }
};

}  // namespace curvisplat
