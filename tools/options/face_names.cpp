#include "tools/options/face_names.h"

#include <algorithm>
#include <charconv>

namespace curvisplat {
namespace {

std::optional<uint64_t> wholeNumber(std::string_view text) {
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// "i=0-20"
bool parseRange(std::string_view text, FaceName& name) {
  const size_t dash = text.find('-');
  if (text.size() < 5 || text[1] != '=' || dash == std::string_view::npos) return false;
  const size_t axis = std::string_view("ijk").find(text[0]);
  const auto first = wholeNumber(text.substr(2, dash - 2)), last = wholeNumber(text.substr(dash + 1));
  if (axis == std::string_view::npos || static_cast<int>(axis) == name.axis || !first || !last ||
      *first >= *last)
    return false;
  name.ranges[axis] = FaceName::Range{*first, *last};
  return true;
}

}  // namespace

std::optional<FaceName> parseFaceName(std::string_view text) {
  FaceName name;
  if (text.starts_with("block")) {
    const size_t colon = text.find(':');
    if (colon == std::string_view::npos) return std::nullopt;
    const size_t from = text.find_first_not_of(' ', 5);
    const auto block = wholeNumber(text.substr(from, colon - from));
    if (!block || *block == 0 || *block > UINT32_MAX) return std::nullopt;
    name.block = static_cast<uint32_t>(*block - 1);
    text.remove_prefix(colon + 1);
  }
  std::string_view ranges;
  if (const size_t colon = text.find(':'); colon != std::string_view::npos) {
    ranges = text.substr(colon + 1);
    text = text.substr(0, colon);
  }
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  if (text.empty()) return std::nullopt;
  const size_t axis = std::string_view("ijk").find(text[0]);
  if (axis == std::string_view::npos) return std::nullopt;
  name.axis = static_cast<int>(axis);
  text.remove_prefix(1);
  const bool has_equals = text.starts_with('=');
  if (has_equals) text.remove_prefix(1);
  if (text == "min" || text == "max") {
    name.at = text == "min" ? FaceName::At::kMin : FaceName::At::kMax;
  } else {
    const auto index = wholeNumber(text);
    if (!has_equals || !index) return std::nullopt;
    name.at = FaceName::At::kIndex;
    name.index = *index;
  }
  while (!ranges.empty()) {
    const size_t colon = std::min(ranges.find(':'), ranges.size());
    if (!parseRange(ranges.substr(0, colon), name)) return std::nullopt;
    ranges.remove_prefix(std::min(colon + 1, ranges.size()));
  }
  return name;
}

}  // namespace curvisplat
