// Options whose values are one of a few words.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

/// Throws UsageError unless `text` is one of the choices: "--volume of: expected on or off (did you mean off?)".
void requireChoice(std::string_view option, std::string_view text, const std::vector<std::string>& choices);

}  // namespace curvisplat
