// Options that choose a scalar and its transfer function, shared by the subcommands that draw.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <optional>
#include <string>

#include "render/colour/transfer_function.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

/// Command-line arguments as given; checked and parsed later.
struct ScalarArguments {
  std::string scalar;
  std::optional<std::string> transfer_function, range, opacity, asinh, opacity_unit;
};

/// Adds --scalar.
void addScalarOption(CLI::App& command, ScalarArguments& arguments);
/// Adds --tf, --range, --opacity, --asinh and --opacity-unit under the heading `group`.
void addFunctionOptions(CLI::App& command, ScalarArguments& arguments, const std::string& group);

/// The names of the options among those of addFunctionOptions() that were given: "--tf and --range".
std::string givenFunctionOptions(const ScalarArguments& arguments);

/// Position of the chosen scalar in the manifest; without a name, the first that varies. Throws Error, not
/// UsageError, for a scalar that the cache lacks: the cache decides, not the usage.
size_t chooseVariable(const CacheReader& cache, const ScalarArguments& arguments);

}  // namespace curvisplat
