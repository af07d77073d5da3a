// Looks at samples of the values a layout gives: are they numbers of a grid, or bits of something else?
#pragma once

#include <optional>
#include <string>

#include "preprocess/formats/plot3d/plot3d_fit.h"

namespace curvisplat {

/// Nothing, or what is wrong with the values, in words. Reads some rows of some blocks. Throws Error if the
/// disk fails.
std::optional<std::string> implausibility(const Plot3dFit& fit);

/// Whether the bytes behind coordinates without iblank could be the first part of an iblank array: a
/// truncated file.
bool trailingLooksLikeIblank(const Plot3dFit& fit);

}  // namespace curvisplat
