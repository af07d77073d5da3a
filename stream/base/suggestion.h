// "Did you mean ...?"
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace curvisplat {

/// The candidate that is closest to `word` by the number of letters to add, remove, change or swap, in any
/// case; empty unless it is at most a third of the word's length. If there is none, the shortest that begins with the
/// word, or that the word begins with: "mach" is mach_number, "isometric" is iso.
std::string closestTo(std::string_view word, std::span<const std::string> candidates);

/// " (did you mean density?)", for the end of a message; empty if nothing is close.
std::string didYouMean(std::string_view word, std::span<const std::string> candidates);

}  // namespace curvisplat
