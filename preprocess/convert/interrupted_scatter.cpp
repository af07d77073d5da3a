#include "preprocess/convert/interrupted_scatter.h"

#include <algorithm>

#include "stream/base/check.h"

namespace curvisplat {

ScatterNotes timedNotes(std::chrono::milliseconds interval, const ScatterState* from,
                        const std::function<void(const ScatterState&)>& write) {
  using Clock = std::chrono::steady_clock;
  const auto next = std::make_shared<Clock::time_point>(Clock::now() + interval);
  return {from, [next] { return Clock::now() >= *next; },
          [=](const ScatterState& state) {
            const Clock::time_point begin = Clock::now();
            write(state);
            const Clock::time_point end = Clock::now();
            *next = end + std::max<Clock::duration>(interval, 20 * (end - begin));
          }};
}

std::unique_ptr<BucketFile> openScattered(const std::filesystem::path& file, const ScatteredSplats& left,
                                          const MemoryPlan& plan) {
  CURVISPLAT_CHECK(left.unfinished.has_value());
  const auto buckets = static_cast<uint32_t>(left.buckets.chains.size());
  if (left.unfinished->slab_bytes > plan.slab_bytes || left.buckets.chunk_bytes > plan.chunkBytes(buckets))
    throw LostBuckets("there is less --memory than before the interruption: all splats are made again");
  return std::make_unique<BucketFile>(file, left.buckets, BucketFile::Use::kAppend);
}

}  // namespace curvisplat
