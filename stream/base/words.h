// Words in texts: the white space around them, and their letters in one case. No locale is asked: letters are those
// of ASCII. For any thread.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

/// What operator>> skips before a word.
inline constexpr std::string_view kWhiteSpace = " \t\n\r\v\f";

/// `text` without the white space at its ends.
std::string_view trimmed(std::string_view text);

/// The parts of `text` between white space; none of them is empty.
std::vector<std::string_view> wordsOf(std::string_view text);

/// `text` with small letters instead of capitals.
std::string lowerCase(std::string_view text);

/// Whether the texts differ in capitals alone.
bool isSameIgnoringCase(std::string_view a, std::string_view b);

}  // namespace curvisplat
