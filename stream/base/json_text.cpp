#include "stream/base/json_text.h"

#include "stream/base/error.h"

namespace curvisplat {

void requireShallowJson(std::string_view text, const std::string& file) {
  constexpr int kDeepest = 64;
  int depth = 0;
  bool in_string = false;
  for (size_t n = 0; n < text.size(); ++n) {
    const char c = text[n];
    if (in_string) {
      if (c == '\\') ++n;
      if (c == '"') in_string = false;
      continue;
    }
    if (c == '"') in_string = true;
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    if (depth > kDeepest)
      throw Error("{}: has brackets more than {} deep at byte {}; the file is damaged or of another kind",
                  file, kDeepest, n);
  }
}

}  // namespace curvisplat
