#include <fmt/format.h>

#include "render/annotate/annotations.h"

namespace curvisplat {

std::string scalarTitle(const std::string& name, const std::string& unit) {
  return unit.empty() ? name : fmt::format("{} [{}]", name, unit);
}

}  // namespace curvisplat
