#include "tools/options/picture_texts.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// Flags, at most two digits, a point and at most two more, and a letter: no width that takes much memory.
bool isFormat(std::string_view format) {
  const auto skip = [&](std::string_view of, size_t most) {
    for (size_t n = 0; n < most && !format.empty() && of.find(format.front()) != std::string_view::npos; ++n)
      format.remove_prefix(1);
  };
  constexpr std::string_view kDigits = "0123456789";
  skip("+- #0", 3);
  skip(kDigits, 2);
  if (format.starts_with('.')) {
    format.remove_prefix(1);
    if (format.empty() || kDigits.find(format.front()) == std::string_view::npos) return false;
    skip(kDigits, 2);
  }
  skip("defgEFGx", 1);
  return format.empty();
}

std::string fieldOf(const std::string& option, const std::string& text, std::string_view field,
                    const TextFields& fields) {
  const size_t colon = std::min(field.find(':'), field.size());
  const std::string_view name = field.substr(0, colon);
  const std::string format(colon < field.size() ? field.substr(colon + 1) : "");
  const auto number = [&](const auto value, const char* otherwise) {
    try {
      if (isFormat(format))
        return fmt::format(fmt::runtime(fmt::format("{{:{}}}", format.empty() ? otherwise : format)), value);
    } catch (const fmt::format_error&) {  // such as {step:.2f}
    }
    throw UsageError("{} {}: '{}' is not a format of {}; expected one such as {}", option, text, format, name,
                     name == "time" ? ".2f" : "04d");
  };
  if (name == "time") return number(fields.time, "g");
  if (name == "step") return number(fields.step, "d");
  if (name == "frame") return number(fields.frame, "d");
  if (!format.empty() && (name == "scalar" || name == "units"))
    throw UsageError("{} {}: {} is no number and has no format", option, text, name);
  if (name == "scalar") return fields.scalar;
  if (name == "units") return fields.units;
  const std::vector<std::string> known{"time", "step", "frame", "scalar", "units"};
  throw UsageError(
      "{} {}: unknown field {{{}}}{}; expected time, step, frame, scalar or units, and {{{{ for a brace",
      option, text, name, didYouMean(name, known));
}

/// Removes from the end of `filled` what stands before a unit that there is none of: the opening bracket of a pair around it, or
/// "in"; and blanks. All after `begin`, where the last field ends.
void removeBeforeUnits(std::string& filled, size_t begin, bool in_brackets) {
  const auto removeBlanks = [&] {
    while (filled.size() > begin && filled.back() == ' ') filled.pop_back();
  };
  if (in_brackets) filled.pop_back();
  removeBlanks();
  const std::string_view before = std::string_view(filled).substr(begin);
  if (in_brackets || !(before.ends_with(" in") || (begin == 0 && before == "in"))) return;
  filled.pop_back();
  filled.pop_back();
  removeBlanks();
}

}  // namespace

std::string filledText(const std::string& option, const std::string& text, const TextFields& fields) {
  std::string filled;
  size_t end_of_field = 0;
  for (size_t n = 0; n < text.size(); ++n) {
    const char c = text[n];
    const bool doubled = n + 1 < text.size() && text[n + 1] == c;
    if (c == '{' && !doubled) {
      const size_t end = text.find('}', n);
      if (end == std::string::npos)
        throw UsageError("{} {}: has a {{ without its }}; {{{{ is a brace", option, text);
      const std::string_view field = std::string_view(text).substr(n + 1, end - n - 1);
      filled += fieldOf(option, text, field, fields);
      n = end;
      if (field == "units" && fields.units.empty()) {
        const char opened = filled.size() > end_of_field ? filled.back() : ' ';
        const char next = end + 1 < text.size() ? text[end + 1] : ' ';
        const bool in_brackets = (opened == '[' && next == ']') || (opened == '(' && next == ')');
        removeBeforeUnits(filled, end_of_field, in_brackets);
        n += in_brackets;
      }
      end_of_field = filled.size();
      continue;
    }
    if ((c == '{' || c == '}') && doubled) ++n;
    filled += c;
  }
  return filled;
}

}  // namespace curvisplat
