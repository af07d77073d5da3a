// How finely a cache stores its scalars: what rounding may have done to a value.
#pragma once

#include <cstddef>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The largest distance, in the scalar's unit, between a sample's mean and the stored one, at the reader's step: half
/// an interval of the leaf with the widest range. Besides, the stored one is a float. Reads tables alone.
double storedWithin(const CacheReader& reader, size_t variable);

}  // namespace curvisplat
