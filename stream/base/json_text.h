// Limits the nesting depth of untrusted JSON before it is parsed.
#pragma once

#include <exception>
#include <string>
#include <string_view>

namespace curvisplat {

/// Throws an Error that names `file` if brackets in `text` nest more than 64 deep. The parser's values are
/// walked, copied and printed recursively, with one stack frame per level, so deep nesting would overflow the
/// stack. No JSON file that the program reads or writes needs that depth.
void requireShallowJson(std::string_view text, const std::string& file);

/// What is wrong with a text that nlohmann::json does not parse, such as "a syntax error at line 3, column 7".
/// `error`: what it threw, whose own text is for programmers.
std::string jsonFault(std::string_view text, const std::exception& error);

}  // namespace curvisplat
