#include "stream/base/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(kWhiteSpace), text.size()));
  return text.substr(0, text.find_last_not_of(kWhiteSpace) + 1);
}

std::vector<std::string_view> wordsOf(std::string_view text) {
  std::vector<std::string_view> words;
  for (text = trimmed(text); !text.empty(); text = trimmed(text)) {
    words.push_back(text.substr(0, text.find_first_of(kWhiteSpace)));
    text.remove_prefix(words.back().size());
  }
  return words;
}

std::string lowerCase(std::string_view text) {
  std::string lowered(text);
  std::ranges::transform(lowered, lowered.begin(), lower);
  return lowered;
}

std::string_view firstBytes(std::string_view text, size_t most) {
  const auto isWithinCharacter = [&](size_t at) { return at < text.size() && (text[at] & 0xc0) == 0x80; };
  size_t end = std::min(most, text.size());
  while (end > 0 && isWithinCharacter(end)) --end;
  return text.substr(0, end);
}

bool isSameIgnoringCase(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, {}, lower, lower);
}

std::string countText(uint64_t count, std::string_view one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

std::string byteText(uint64_t bytes) {
  constexpr std::array kUnits = {"KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
  if (bytes < 1024) return countText(bytes, "byte");
  double size = static_cast<double>(bytes) / 1024;
  size_t unit = 0;
  // From what would be printed as 1024, the next unit is shorter.
  for (; size >= 1023.5 && unit + 1 < kUnits.size(); ++unit) size /= 1024;
  return fmt::format("{:.4g} {}", size, kUnits[unit]);
}

std::string numberText(double value, int digits) {
  return std::isnan(value) ? "NaN" : fmt::format("{:.{}g}", value, digits);
}

namespace {

/// `word` as $'...', with escapes for all but printable ASCII.
std::string withEscapes(const std::string& word) {
  std::string text = "$'";
  for (const char c : word) {
    if (c == '\'' || c == '\\')
      text += {'\\', c};
    else if (c >= ' ' && c <= '~')
      text += c;
    else
      text += fmt::format("\\{:03o}", static_cast<unsigned char>(c));
  }
  return text + "'";
}

}  // namespace

std::string shellWord(const std::string& word) {
  if (oneLine(word) != word) return withEscapes(word);
  const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
    return std::isalnum(c) ||
           std::string_view("_-./,:=+@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (plain) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::string shellOption(const std::string& option, const std::string& word) {
  return option + (word.starts_with('-') ? '=' : ' ') + shellWord(word);
}

namespace {

/// The distance of Damerau and Levenshtein, in which two swapped neighbours count as one change.
size_t distance(std::string_view a, std::string_view b) {
  std::vector<size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const bool same = a[i - 1] == b[j - 1];
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (same ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before.swap(last);
    last.swap(row);
  }
  return last[b.size()];
}

/// Whether `word` begins with `begin`, ignoring case.
bool beginsWith(std::string_view word, std::string_view begin) {
  return word.size() >= begin.size() && isSameIgnoringCase(word.substr(0, begin.size()), begin);
}

/// The shortest candidate that begins with the word or that the word begins with. Both must have at least
/// three letters; minus signs in front are ignored.
std::string sharingTheBegin(std::string_view word, std::span<const std::string> candidates) {
  std::string best;
  for (const std::string& candidate : candidates) {
    const std::string_view letters =
        std::string_view(candidate).substr(std::min(candidate.size(), candidate.find_first_not_of('-')));
    const std::string_view own = word.substr(std::min(word.size(), word.find_first_not_of('-')));
    if (std::min(letters.size(), own.size()) < 3) continue;
    if (!beginsWith(letters, own) && !beginsWith(own, letters)) continue;
    if (best.empty() || candidate.size() < best.size()) best = candidate;
  }
  return best;
}

}  // namespace

std::string closestTo(std::string_view word, std::span<const std::string> candidates) {
  constexpr size_t kMaxWord = 64;  // longer ones are no misspelled names
  if (word.empty() || word.size() > kMaxWord) return {};
  const std::string letters_of_word = lowerCase(word);
  std::string best;
  size_t least = std::max<size_t>(1, word.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    if (candidate.size() > 2 * kMaxWord) continue;
    const size_t letters = distance(letters_of_word, lowerCase(candidate));
    const bool is_closer_in_a_tie =
        letters == least && !best.empty() && beginsWith(candidate, word) && !beginsWith(best, word);
    if (letters >= least && !is_closer_in_a_tie) continue;
    if (letters >= std::max(word.size(), candidate.size())) continue;  // they share no letter
    least = letters;
    best = candidate;
  }
  return best.empty() ? sharingTheBegin(word, candidates) : best;
}

std::string didYouMean(std::string_view word, std::span<const std::string> candidates) {
  const std::string close = closestTo(word, candidates);
  return close.empty() ? "" : fmt::format(" (did you mean {}?)", close);
}

}  // namespace curvisplat
