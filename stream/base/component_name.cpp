#include "stream/base/component_name.h"

#include <algorithm>

namespace curvisplat {

std::string_view vectorOf(std::string_view name) {
  const auto isIn = [](char c, std::string_view set) { return set.find(c) != std::string_view::npos; };
  if (const size_t colon = name.rfind(':'); colon != std::string_view::npos) {
    const std::string_view part = name.substr(colon + 1);
    const bool number =
        !part.empty() && std::all_of(part.begin(), part.end(), [&](char c) { return isIn(c, "0123456789"); });
    const bool axis = part.size() == 1 && isIn(part[0], "xyz");
    return number || axis || part == "mag" ? name.substr(0, colon) : std::string_view();
  }
  if (name.size() < 2 || !isIn(name.back(), "XYZ")) return {};
  const char before = name[name.size() - 2];
  return before >= 'a' && before <= 'z' ? name.substr(0, name.size() - 1) : std::string_view();
}

}  // namespace curvisplat
