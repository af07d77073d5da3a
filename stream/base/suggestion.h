// "Did you mean ...?"
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace curvisplat {

/// The candidate that is closest to `word` by the number of letters to add, remove, change or swap, in any
/// case; empty unless it is at most a third of the word's length.
std::string closestTo(std::string_view word, std::span<const std::string> candidates);

}  // namespace curvisplat
