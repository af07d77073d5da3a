#include "tools/throughput/brick_sample.h"

namespace curvisplat {

BrickSample sampleOf(std::span<const BrickPart> parts, std::span<const Brick> bricks, uint64_t max_splats,
                     uint32_t runs) {
  const auto splatsOf = [&](const BrickPart& part) {
    return uint64_t{SplatRanges(bricks[part.brick], part.octants).splats()};
  };
  uint64_t all = 0;
  for (const BrickPart& part : parts) all += splatsOf(part);
  BrickSample sample;
  if (all <= max_splats) {
    sample.parts.assign(parts.begin(), parts.end());
    sample.splats = all;
    return sample;
  }
  // Run r begins after a fraction r / runs of all splats, and holds 1 / runs of the sample.
  uint64_t behind = 0;
  uint32_t run = 0;
  uint64_t wanted = 0;
  for (const BrickPart& part : parts) {
    const uint64_t splats = splatsOf(part);
    while (run < runs && static_cast<double>(behind) >= static_cast<double>(all) / runs * run) {
      ++run;
      wanted = max_splats / runs * run;
    }
    if (sample.splats < wanted || sample.parts.empty()) {
      sample.parts.push_back(part);
      sample.splats += splats;
    }
    behind += splats;
  }
  return sample;
}

}  // namespace curvisplat
