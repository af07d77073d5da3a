#include "tools/options/choices.h"

#include "stream/base/error.h"
#include "stream/base/suggestion.h"

namespace curvisplat {

void requireChoice(std::string_view option, std::string_view text, const std::vector<std::string>& choices) {
  std::string listed;
  for (size_t n = 0; n < choices.size(); ++n) {
    if (choices[n] == text) return;
    listed += (n == 0 ? "" : n + 1 == choices.size() ? " or " : ", ") + choices[n];
  }
  throw UsageError("{} {}: expected {}{}", option, text, listed, didYouMean(text, choices));
}

}  // namespace curvisplat
