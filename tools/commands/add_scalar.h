// `curvisplat convert GRID SOLUTION --add-scalar NAME --to CACHE`.
#pragma once

#include "tools/options/convert_words.h"

namespace curvisplat {

/// Throws UsageError where the words do not go together.
void runAddScalar(ConvertWords words);

}  // namespace curvisplat
