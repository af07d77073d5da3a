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
  std::string scalar, transfer_function = "viridis";
  std::optional<std::string> range, opacity_unit;
};

/// Adds --scalar.
void addScalarOption(CLI::App& command, ScalarArguments& arguments);
/// Adds --tf, --range and --opacity-unit under the heading `group`.
void addFunctionOptions(CLI::App& command, ScalarArguments& arguments, const std::string& group);

/// Position of the chosen scalar in the manifest. Throws Error, not UsageError, for a scalar that the cache
/// lacks: the cache decides, not the usage.
size_t chooseVariable(const CacheReader& cache, const ScalarArguments& arguments);

/// `diagonal`: length of the diagonal of the data's bounding box after --scale, in world units. Throws
/// UsageError, or Error if the file does not hold a transfer function.
TransferFunction chooseTransferFunction(const ScalarArguments& arguments, const VariableInfo& variable,
                                        double diagonal);

}  // namespace curvisplat
