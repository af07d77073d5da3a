// Tests that try every place where something may go wrong: each call, each byte, each attribute. All of them take
// minutes, so that usually only some are tried.
#pragma once

#include <cstdint>
#include <cstdlib>

namespace curvisplat::faults {

/// Whether all places are to be tried: CURVISPLAT_WHOLE_SWEEPS is set, as tools/test.sh --whole does.
inline bool isWholeSweep() {
  return std::getenv("CURVISPLAT_WHOLE_SWEEPS") != nullptr;
}

/// The place to try after this one. The first ones, where files are opened and made, are all tried; of the others
/// usually one in `stride`, which should have no divisor in common with what repeats in the job.
inline int64_t nextInSweep(int64_t place, int64_t stride) {
  constexpr int64_t kFirstOnes = 12;
  return place + (place < kFirstOnes || isWholeSweep() ? 1 : stride);
}

}  // namespace curvisplat::faults
