// Judges a layout by some of the values it gives: are they coordinates or fields, or noise?
#pragma once

#include <optional>
#include <string>

#include "preprocess/formats/plot3d/plot3d_fit.h"

namespace curvisplat {

/// nullopt if the values are plausible; else a description of the problem. Reads some rows of some blocks.
/// Throws Error if reading fails.
std::optional<std::string> implausibility(const Plot3dFit& fit);

/// Whether the bytes after coordinates without iblank could be the beginning of an iblank array, which would
/// mean that the file is truncated.
bool trailingLooksLikeIblank(const Plot3dFit& fit);

}  // namespace curvisplat
