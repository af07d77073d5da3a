// Which scalar of a cache, and in which colours: the options that all subcommands with pictures share.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <optional>
#include <string>

#include "render/colour/transfer_function.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// The command line's words, as given.
struct ScalarArguments {
  std::string scalar, transfer_function = "viridis";
  std::optional<std::string> range, opacity_unit;
};

/// --scalar.
void addScalarOption(CLI::App& command, ScalarArguments& words);
/// --tf, --range and --opacity-unit, under the heading `group`.
void addFunctionOptions(CLI::App& command, ScalarArguments& words, const std::string& group);

/// Position of the scalar. One that the cache lacks is bad input, not wrong usage, since the cache decides:
/// throws Error.
size_t chooseVariable(const CacheReader& cache, const ScalarArguments& words);

/// `diagonal` of the data, after --scale. Throws UsageError, and Error for a file that is no function.
TransferFunction chooseTransferFunction(const ScalarArguments& words, const VariableInfo& variable,
                                        double diagonal);

}  // namespace curvisplat
