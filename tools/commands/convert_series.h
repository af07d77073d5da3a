// The mode of `curvisplat convert` for several time steps: a new cache of a series, or steps for an existing one.
#pragma once

#include "tools/options/convert_arguments.h"

namespace curvisplat {

/// Whether the files or the options name several time steps. Expands patterns among the files. Throws Error.
bool isSeries(ConvertArguments& arguments);

/// Converts the series, or adds its steps to the cache --to. Throws UsageError and Error.
void runConvertSeries(ConvertArguments arguments);

/// Joins the parts that --part has written. Throws as runConvertSeries().
void runJoinSeries(ConvertArguments arguments);

}  // namespace curvisplat
