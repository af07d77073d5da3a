#include "stream/cache/coarse_level.h"

namespace curvisplat {

std::vector<uint32_t> bricksAtALevel(const CacheReader& cache, uint64_t min_splats) {
  const auto bricks = cache.bricks();
  for (uint32_t level = 0;; ++level) {
    std::vector<uint32_t> chosen;
    uint64_t splats = 0;
    bool deeper = false;
    for (uint32_t n = 0; n < bricks.size(); ++n) {
      const uint32_t own = bricks[n].cell.level;
      if (own == level || (own < level && bricks[n].isLeaf())) {
        chosen.push_back(n);
        splats += bricks[n].splats;
      }
      deeper |= own > level;
    }
    if (splats >= min_splats || !deeper) return chosen;
  }
}

}  // namespace curvisplat
