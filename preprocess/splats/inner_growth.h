// Growth codes of the nodes that inner_nodes.h computes, also several at once. Most cells grow along one axis of the lattice, or
// along none; the codes of the others are left to growthCode().
#pragma once

#include <array>
#include <cstdint>

#include "preprocess/splats/inner_nodes.h"

namespace curvisplat {

/// No code (stream/model/growth_code.h): the cell grows along several axes.
inline constexpr int32_t kGrowsAlongSeveral = -1;

struct alignas(64) InnerGrowthCodes {
  int32_t of[kInnerNodesAtOnce];  // as growthCode(), the same bits; or kGrowsAlongSeveral
};

/// `growth`: [axis][node], of the nodes of `splats`. Pure: any thread. Never allocates.
void findInnerGrowth(const InnerSplats& splats, const std::array<const float*, 3>& growth,
                     InnerGrowthCodes& out);

}  // namespace curvisplat
