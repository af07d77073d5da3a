// Comparison of scalar names, which differ between files, programs and users in case and underscores.
#pragma once

#include <string>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The name in lower case without spaces, underscores and hyphens.
std::string simplifiedName(const std::string& name);

/// Whether `simple` (a simplified name) is the scalar's name or one of its aliases.
bool answersTo(const GridScalar& scalar, const std::string& simple);

}  // namespace curvisplat
