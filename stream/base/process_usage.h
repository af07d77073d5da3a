// The system's counters of this process, for --stats.
#pragma once

#include <cstdint>

namespace curvisplat {

struct ProcessUsage {
  double cpu_seconds = 0;   // all threads, user and system time
  uint64_t bytes_read = 0;  // by system calls, from the page cache or the disk
  uint64_t bytes_written = 0;
  uint64_t memory_bytes = 0;       // VmRSS: resident memory
  uint64_t peak_memory_bytes = 0;  // VmHWM: the largest VmRSS so far

  /// Totals since the process started; 0 for numbers that the system does not provide. Any thread; takes
  /// about 20 us.
  static ProcessUsage now();
};

}  // namespace curvisplat
