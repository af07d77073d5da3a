// A brick's splats in double precision, on their way into the codec or out of it for merging.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// What conversion hands over: one brick in double precision, in the order in which it will be stored.
struct BrickSplats {
  Cell cell;
  std::vector<NodeRun>
      runs;  // leaves: the nodes behind the splats, counts sum to size(); inner bricks: empty
  std::vector<RootPosition> positions;              // in `cell`
  std::vector<Splat> splats;                        // .position is ignored in favour of `positions`
  std::vector<uint32_t> border_codes;               // [splat]; stream/model/border_code.h. Empty: no borders
  std::vector<uint32_t> growth_codes;               // [splat]; stream/model/growth_code.h. Empty: no growth
  std::vector<std::vector<SplatScalar>> variables;  // [variable][splat]

  size_t size() const { return splats.size(); }
};

}  // namespace curvisplat
