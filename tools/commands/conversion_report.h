// Reports on a conversion: before it, what it will take (--dry-run), and after it, how precisely the values
// are stored. --dry-run converts a sample of the grid and leaves nothing behind. For the main thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

#include "preprocess/addition/convert_series.h"
#include "preprocess/convert/convert.h"
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

/// StoredScalars has the largest errors of scalars that are stored, and the names of those that have one value everywhere.
struct StoredScalars {
  std::vector<double> errors;
  std::vector<std::string> constant;
};

/// Prints a line for each scalar of a cache that has just been written: "p: 0.1 .. 2.5 Pa, rounded within 1.8e-05, typically
/// 1.0e-05". `where` follows the scalar's name. Prints a warning, and returns nothing, if the cache cannot be read; that does not
/// undo the conversion.
StoredScalars printStored(const std::filesystem::path& cache, uint64_t step = 0, std::string_view where = "");

}  // namespace curvisplat
