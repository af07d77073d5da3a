// Warnings where a picture asks for finer differences of a scalar than its cache stores. From the index and the percentiles alone, without
// reading bricks. Any thread.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "render/colour/transfer_function.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The widest step, twice the largest error, of stored values between `lower` and `upper`; 0 if there are none.
double storedStep(const CacheReader& cache, size_t variable, double lower, double upper);

/// A warning if the function's range has fewer than 100 steps, or fewer than 20 within the width around the centre of an asinh, or in the
/// first decade of a logarithm; empty otherwise.
std::string functionFinerThanStored(const CacheReader& cache, size_t variable,
                                    const TransferFunction& function);

/// A warning for each isovalue from which more than 2 % of the volume lies no further than a step, where its surface follows the values'
/// rounding, or where steps are wider than 5 % of its own scale (ValueSpread). `isovalues`: as given, of numbers.
std::vector<std::string> isovaluesFinerThanStored(const CacheReader& cache, size_t variable,
                                                  std::span<const std::string> isovalues);

}  // namespace curvisplat
