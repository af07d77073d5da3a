// Where a name leads that a person has given.
#pragma once

#include <filesystem>

namespace curvisplat {

/// `path`, or what is at the end of the links that it names, whether that is there or not. Throws Error if
/// they go round.
std::filesystem::path linkTarget(std::filesystem::path path);

}  // namespace curvisplat
