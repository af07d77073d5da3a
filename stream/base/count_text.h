// Counted things, for people.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace curvisplat {

/// "1 brick", "2 bricks": `one` is the word for one of them, of those whose plural is made with an s.
inline std::string countText(uint64_t count, std::string_view one) {
  return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
}

/// The verb behind it: "1 brick is", "2 bricks are".
inline const char* isOrAre(uint64_t count) {
  return count == 1 ? "is" : "are";
}

}  // namespace curvisplat
