// What is asked of any JSON text before a parser gets it.
#pragma once

#include <string>
#include <string_view>

namespace curvisplat {

/// Throws Error naming `file` where brackets nest deeper than in any file of ours: values are walked, copied
/// and printed recursively, a stack's frame a level.
void requireShallowJson(std::string_view text, const std::string& file);

}  // namespace curvisplat
