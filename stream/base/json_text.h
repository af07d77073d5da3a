// What is asked of any JSON text before a parser gets it.
#pragma once

#include <exception>
#include <string>
#include <string_view>

namespace curvisplat {

/// Throws Error naming `file` where brackets nest deeper than in any file of ours: values are walked, copied
/// and printed recursively, a stack's frame a level.
void requireShallowJson(std::string_view text, const std::string& file);

/// What is wrong with a text that nlohmann::json does not parse, such as "a syntax error at line 3, column 7".
/// `error`: what it threw, whose own text is for programmers.
std::string jsonFault(std::string_view text, const std::exception& error);

}  // namespace curvisplat
