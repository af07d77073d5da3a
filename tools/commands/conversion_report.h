// Reports on a conversion: before it, what it will take (--dry-run), and after it, how precisely the values
// are stored. --dry-run converts a sample of the grid and leaves nothing behind. For the main thread.
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
#include "stream/cache/cache_reader.h"
#include "tools/options/convert_arguments.h"

namespace curvisplat {

/// Prints bytes, memory and time that convert() of `source` with these options will take, and writes them to
/// --stats. Unstructured grids are not sampled; their figures come from earlier conversions. Throws what
/// convert() would throw at its beginning, and Interrupted.
void dryRun(std::unique_ptr<DataSource> source, const ConvertOptions& options,
            const ConvertArguments& arguments);

/// Does the same for a series: samples its first two steps, and assumes that further ones take as much as
/// the second.
void dryRunOfSeries(const SeriesInput& input, const SeriesOptions& options,
                    const ConvertArguments& arguments);

/// Opens a complete cache at a step, to print what it holds. Returns null and prints a warning if the cache
/// cannot be read; that does not undo the conversion.
std::unique_ptr<CacheReader> openWritten(const std::filesystem::path& cache, uint64_t step = 0);

/// Prints a line for each scalar at the reader's step: "p: 0.1 .. 2.5 Pa, rounded within 1.8e-05". `where`
/// follows the scalar's name.
void printStoredPrecision(const CacheReader& cache, std::string_view where = "");

}  // namespace curvisplat
