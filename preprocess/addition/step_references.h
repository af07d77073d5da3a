// Which earlier steps the values of a new step are predicted from, and what a brick has there.
//
// The steps of a geometry come in groups of kStepGroup. The first of a group is coded alone; the second is predicted from
// the first; the third from both, by carrying the change between them on. So any step decodes from three streams at
// most, and it depends only on earlier steps, whatever is added later.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "stream/codec/brick_codec.h"

namespace curvisplat {

inline constexpr uint64_t kStepGroup = 3;

/// Which steps of a series the next one on `geometry` is predicted from, the nearest first; `series` may have later
/// steps than those before `next`. `leaves_out_first`: step 0 belongs to no group, as in a part of a series
/// (series_part.h).
std::vector<uint64_t> referenceSteps(const Series& series, uint32_t geometry, uint64_t next,
                                     bool leaves_out_first = false);

/// Immutable; any thread.
class StepReferences {
 public:
  /// Of a step that is about to be added to the series, on the geometry that `cache` is open at. Throws Error.
  explicit StepReferences(const CacheReader& cache, bool leaves_out_first = false);

  /// A thread's memory for what of() lends.
  struct Scratch {
    std::array<SplatVariable, 2> values;
  };
  /// Lent until the next call with the same scratch. Throws as CacheReader::readVariable().
  TimeReferences of(uint32_t brick, size_t variable, Scratch& scratch) const;

 private:
  std::array<uint8_t, 2> steps_back_{};
  std::vector<CacheReader> readers_;  // [reference]
};

}  // namespace curvisplat
