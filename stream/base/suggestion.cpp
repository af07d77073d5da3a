#include "stream/base/suggestion.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "stream/base/words.h"

namespace curvisplat {
namespace {

/// Damerau and Levenshtein's distance, in which two letters that are swapped count once.
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

/// With capitals or small letters.
bool beginsWith(std::string_view word, std::string_view begin) {
  return word.size() >= begin.size() && isSameIgnoringCase(word.substr(0, begin.size()), begin);
}

/// The shortest candidate that the word begins, or that begins the word, of three letters at least.
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
