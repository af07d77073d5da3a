// Names of the grid's faces, as users give them: imin, kmax, k=10, "block 3:k=min", and a part of one: kmin:i=0-20.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace curvisplat {

struct FaceName {
  std::optional<uint32_t> block;  // from 0; none: all
  int axis = 0;
  enum class At { kMin, kMax, kIndex } at = At::kMin;
  uint64_t index = 0;  // from 0
  /// Nodes FIRST-LAST along the other axes.
  struct Range {
    uint64_t first = 0, last = 0;
  };
  std::array<std::optional<Range>, 3> ranges{};  // along i, j, k
};

/// Nothing if the text has another form.
std::optional<FaceName> parseFaceName(std::string_view text);

}  // namespace curvisplat
