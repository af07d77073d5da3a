// A picture of the built-in colour maps with their names.
#pragma once

#include "render/image/image.h"

namespace curvisplat {

/// All maps by category, in three columns on white. Throws UsageError in a build without Cairo.
Image colourMapSheet();

}  // namespace curvisplat
