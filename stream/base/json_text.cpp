#include "stream/base/json_text.h"

#include <algorithm>
#include <nlohmann/json.hpp>

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

std::string jsonFault(std::string_view text, const std::exception& error) {
  const auto* const syntax = dynamic_cast<const nlohmann::json::parse_error*>(&error);
  if (!syntax) return "a number that is too large";  // nothing else is thrown while parsing
  if (text.find_first_not_of(" \t\r\n") == std::string_view::npos) return "no text";
  const std::string_view before = text.substr(0, syntax->byte > 0 ? syntax->byte - 1 : 0);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const size_t begin = before.rfind('\n') + 1;  // 0 if there is none
  return fmt::format("a syntax error at line {}, column {}", line, before.size() - begin + 1);
}

}  // namespace curvisplat
