// Lists names in messages. Files can have tens of thousands of scalars, and a message is one line that people read.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace curvisplat {

inline constexpr size_t kMaxNamesListed = 40;

/// "a, b, c"; of more than `most` names the first ones and how many more there are: "a, b and 998 more".
std::string listed(std::span<const std::string> names, size_t most = kMaxNamesListed);

}  // namespace curvisplat
