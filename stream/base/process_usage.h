// What the system has counted of this process: for --stats.
#pragma once

#include <cstdint>

namespace curvisplat {

struct ProcessUsage {
  double cpu_seconds = 0;   // of all threads, in the program and in the system
  uint64_t bytes_read = 0;  // through system calls, from the page cache or the disk
  uint64_t bytes_written = 0;
  uint64_t memory_bytes = 0;       // VmRSS: the part of it that is in memory
  uint64_t peak_memory_bytes = 0;  // VmHWM: the largest that this was

  /// Since the process began. Numbers that the system does not tell are 0. Any thread; costs some 20 us.
  static ProcessUsage now();
};

}  // namespace curvisplat
