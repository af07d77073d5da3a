// What `convert` prints of the precision of the values that it has written.
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Opens a cache that is complete and in place, at a step, for what is printed of it. Null, with a warning, if it cannot be
/// read: that does not undo the conversion.
std::unique_ptr<CacheReader> openWritten(const std::filesystem::path& cache, uint64_t step = 0);

/// One line for each scalar, of the reader's step: "p: 0.1 .. 2.5 Pa, rounded within 1.8e-05". `where` follows its name.
void printStoredPrecision(const CacheReader& cache, std::string_view where = "");

}  // namespace curvisplat
