// Reads and writes short texts: splits a text into words and compares them ignoring case, writes counts and
// sizes for people, quotes words for a shell, and finds the name that was meant by a misspelled one.
//
// No function asks the locale: letters are those of ASCII. All functions are pure, so any thread may call
// them. Many sources include this header; it includes nothing of fmt, so that they compile fast.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

/// The white space between words: the characters that operator>> skips.
inline constexpr std::string_view kWhiteSpace = " \t\n\r\v\f";

/// `text` without the white space at its ends.
std::string_view trimmed(std::string_view text);

/// The parts of `text` between white space; none of them is empty.
std::vector<std::string_view> wordsOf(std::string_view text);

/// `text` with small letters instead of capitals.
std::string lowerCase(std::string_view text);

/// The first `most` bytes of `text`, fewer where they would end within a character of UTF-8.
std::string_view firstBytes(std::string_view text, size_t most);

/// Whether the texts differ in capitals alone.
bool isSameIgnoringCase(std::string_view a, std::string_view b);

/// A number of things: "1 brick", "2 bricks". `one`: the singular, of a word whose plural ends with an s.
std::string countText(uint64_t count, std::string_view one);

/// The verb that follows countText(): "1 brick is", "2 bricks are".
inline const char* isOrAre(uint64_t count) {
  return count == 1 ? "is" : "are";
}

/// A size: "1 byte", "512 bytes", "1 KiB", "1.5 MiB", "96.25 GiB". It has up to four digits, so that sizes
/// that differ by little read differently. Units are powers of 1024.
std::string byteText(uint64_t bytes);

/// A number with up to `digits` digits, as "{:g}" has it; NaN is "NaN", whatever its sign.
std::string numberText(double value, int digits = 6);

/// `word` as a user copies it into a shell (bash, zsh or POSIX 2024), which reads back the same word. It is
/// quoted only if it has to be; control characters become escapes, since a terminal would obey them.
std::string shellWord(const std::string& word);

/// "--option word", the word quoted by shellWord(). "--option=word" if the word begins with a minus sign:
/// the parser would take it for an option otherwise.
std::string shellOption(const std::string& option, const std::string& word);

/// The candidate that is closest to `word`, by the number of letters to add, remove, change or swap; case is
/// ignored. At most a third of the word's letters may differ. If no candidate is that close, the shortest
/// one that begins with the word or that the word begins with ("mach": mach_number; "isometric": iso); empty
/// if there is none either.
std::string closestTo(std::string_view word, std::span<const std::string> candidates);

/// " (did you mean density?)", for the end of a message; empty if closestTo() finds nothing.
std::string didYouMean(std::string_view word, std::span<const std::string> candidates);

}  // namespace curvisplat
