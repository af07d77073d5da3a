#include "stream/base/name_list.h"

#include <fmt/format.h>

#include <algorithm>

namespace curvisplat {

std::string listed(std::span<const std::string> names, size_t most) {
  const std::span<const std::string> first = names.first(std::min(names.size(), most));
  const std::string text = fmt::format("{}", fmt::join(first, ", "));
  return first.size() == names.size() ? text : fmt::format("{} and {} more", text, names.size() - most);
}

}  // namespace curvisplat
