#include "stream/cache/stored_precision.h"

#include <algorithm>

#include "stream/codec/values_codec.h"

namespace curvisplat {

double storedWithin(const CacheReader& reader, size_t variable) {
  double range = 0;
  for (size_t n = 0; n < reader.bricks().size(); ++n) {
    if (!reader.bricks()[n].isLeaf()) continue;
    const BrickVariable& values = reader.brickVariables(variable)[n];
    range = std::max(range, double{values.max} - double{values.min});
  }
  return range * (reader.manifest().hasFeature(kFineValues) ? kLargestFineMeanError : kLargestMeanError);
}

}  // namespace curvisplat
