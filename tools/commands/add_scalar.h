// `curvisplat convert GRID SOLUTION --add-scalar NAME --to CACHE`.
#pragma once

#include "tools/options/convert_arguments.h"

namespace curvisplat {

/// Adds the scalars and prints a summary. Throws UsageError if options contradict each other, and Error.
void runAddScalar(ConvertArguments arguments);

}  // namespace curvisplat
