// Tests that try every place where something may go wrong: each call, each byte, each attribute. All of them
// take minutes, so that usually only some are tried (nextInSweep); tools/test.sh --whole tries all. Tests that
// take long for other reasons ask isWholeSweep(), too.
// FaultSweep does so with a disk: it does a job again and again, and the first call fails, the second one,
// ... until the job ends before it comes to the call that would fail.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <string>

#include "tests/support/faulty_system_calls.h"

namespace curvisplat::faults {

/// Whether all places are to be tried: CURVISPLAT_WHOLE is set, as tools/test.sh --whole does.
inline bool isWholeSweep() {
  return std::getenv("CURVISPLAT_WHOLE") != nullptr;
}

/// Whether to try the n-th of many combinations: usually one in `stride`, which has no divisor in common with what they are made of.
inline bool isTried(size_t n, size_t stride) {
  return n % stride == 0 || isWholeSweep();
}

/// The place to try after this one. The first ones, where files are opened and made, are all tried; of the others
/// usually one in `stride`, which should have no divisor in common with what repeats in the job.
inline int64_t nextInSweep(int64_t place, int64_t stride, int64_t first_ones = 12) {
  return place + (place < first_ones || isWholeSweep() ? 1 : stride);
}

/// A fault at the n-th call of a kind.
struct Fault {
  const char* name;
  int64_t FaultySystemCalls::*at;
  int error;
};

inline constexpr Fault kFailsOnce{"EIO once", &FaultySystemCalls::fail_only_call_at, EIO};
inline constexpr Fault kFailsFromThenOn{"EIO from then on", &FaultySystemCalls::fail_call_at, EIO};
inline constexpr Fault kIsFull{"ENOSPC", &FaultySystemCalls::fail_write_at, ENOSPC};
inline constexpr Fault kHasNoNames{"ENOSPC at a new name", &FaultySystemCalls::fail_name_at, ENOSPC};
inline constexpr Fault kFailsToSync{"EIO at syncing", &FaultySystemCalls::fail_sync_at, EIO};
inline constexpr Fault kFailsToRename{"EIO at renaming", &FaultySystemCalls::fail_rename_at, EIO};
inline constexpr Fault kIsCutOff{"cut to half", &FaultySystemCalls::cut_at, 0};
inline constexpr Fault kFaults[] = {kFailsOnce,   kFailsFromThenOn, kIsFull,  kHasNoNames,
                                    kFailsToSync, kFailsToRename,   kIsCutOff};

/// Whether a message names a file or folder that only exists while the program works, such as "a.splats.partial",
/// "a.splats.tmp.17.0" and "curvisplat.0123abcd.tmp".
bool namesTemporaryFile(const std::string& message);

/// The outcome of a job.
struct FaultOutcome {
  std::string error;                 // what it threw; empty: it says that it has done its work
  bool has_refused_removal = false;  // so something may be left
  bool has_struck = false;           // else it ended before
};

struct FaultSweep {
  std::string in_message;  // every Error names something whose path begins so
  std::string to_be_cut;   // only files whose paths begin so become shorter
  std::function<void()> prepare, job;
  std::function<void(const FaultOutcome&)> check;
  int64_t stride = 11;

  /// Calls prepare(), job() with the fault at the n-th call, and check(outcome), for the first n and one in `stride` of
  /// the others, or with tools/test.sh --whole for all n, until the fault is not reached any more. Expects that a failing
  /// job throws an Error of one line that names a path and the reason, and no temporary file where the disk is full, and
  /// that no descriptor is lost. Returns how many faults were tried.
  int64_t run(const Fault& fault) const;
};

}  // namespace curvisplat::faults
