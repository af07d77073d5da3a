#include "stream/error.h"

#include <algorithm>
#include <cstdlib>

#include "stream/say.h"

namespace curvisplat {

std::string oneLine(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; }, ' ');
  return text;
}

void checkFailed(const char* file, int line, const char* expression, const std::string& values) {
  say("internal error at {}:{}: {} does not hold{}{}", file, line, expression, values.empty() ? "" : ": ",
      values);
  std::abort();
}

}  // namespace curvisplat
