// Lines of results on standard output that quote names from files.
#pragma once

#include <fmt/format.h>

#include <utility>

#include "stream/base/error.h"

namespace curvisplat {

/// Prints one line: control characters, which a terminal would obey, become spaces.
template <typename... Args>
void printLine(fmt::format_string<Args...> format, Args&&... args) {
  fmt::print("{}\n", oneLine(fmt::format(format, std::forward<Args>(args)...)));
}

}  // namespace curvisplat
