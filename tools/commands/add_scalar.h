// `curvisplat convert GRID SOLUTION --add-scalar NAME --to CACHE`.
#pragma once

#include "tools/options/convert_arguments.h"

namespace curvisplat {

/// Throws UsageError where the words do not go together.
void runAddScalar(ConvertArguments words);

}  // namespace curvisplat
