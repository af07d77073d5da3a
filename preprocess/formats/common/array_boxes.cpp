#include "preprocess/formats/common/array_boxes.h"

#include <algorithm>
#include <array>
#include <numeric>

namespace curvisplat {

uint64_t arrayProduct(std::span<const uint64_t> counts) {
  return std::accumulate(counts.begin(), counts.end(), uint64_t{1}, std::multiplies<>());
}

void forEachArrayBox(std::span<const uint64_t> dims, uint64_t begin, uint64_t count, const UseArrayBox& use) {
  const size_t rank = dims.size();
  std::array<uint64_t, kMaxArrayRank> first{}, along{};
  while (count > 0) {
    uint64_t rest = begin;
    for (size_t d = rank; d-- > 0;) {
      first[d] = rest % dims[d];
      rest /= dims[d];
      along[d] = 1;
    }
    // The largest box that begins here: whole rows, whole planes, ... as far as the range goes.
    uint64_t block = 1;
    for (size_t d = rank; d-- > 0;) {
      const uint64_t most = std::min<uint64_t>(dims[d] - first[d], count / block);
      if (most == 0) break;
      along[d] = most;
      const bool whole = most == dims[d];
      block *= most;
      if (!whole) break;
    }
    use(std::span(first).first(rank), std::span(along).first(rank));
    begin += block;
    count -= block;
  }
}

}  // namespace curvisplat
