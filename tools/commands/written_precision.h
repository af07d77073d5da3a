// What `convert` prints of the precision of the values that it has written.
#pragma once

#include <string_view>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// One line for each scalar, of the reader's step: "p: 0.1 .. 2.5 Pa, rounded within 1.8e-05". `where` follows its name.
void printStoredPrecision(const CacheReader& cache, std::string_view where = "");

}  // namespace curvisplat
