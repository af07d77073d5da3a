#include "stream/paging/read_batch.h"

#include <algorithm>
#include <numeric>

#include "stream/base/error.h"
#include "stream/cache/cache_format.h"

namespace curvisplat {
namespace {

uint64_t pageOf(uint64_t offset) {
  return offset / kPageBytes * kPageBytes;
}

uint64_t pagesEnd(const Extent& extent) {
  return pageOf(extent.offset + extent.length + kPageBytes - 1);
}

size_t bricksWithin(std::span<const BrickExtents> bricks, uint64_t limit_bytes) {
  uint64_t bytes = 0;
  size_t count = 0;
  while (count < std::min(bricks.size(), kMaxBatchBricks)) {
    bytes += pagedBytes(bricks[count]);
    if (count > 0 && bytes > limit_bytes) break;
    ++count;
  }
  return count;
}

}  // namespace

uint64_t pagedBytes(const BrickExtents& brick) {
  uint64_t bytes = 0;
  for (const Extent& extent : brick)
    if (extent.length > 0) bytes += pagesEnd(extent) - pageOf(extent.offset);
  return bytes;
}

ReadBatch planBatch(std::span<const BrickExtents> all_bricks, uint64_t limit_bytes) {
  CURVISPLAT_CHECK(!all_bricks.empty());
  const std::span<const BrickExtents> bricks = all_bricks.first(bricksWithin(all_bricks, limit_bytes));
  ReadBatch batch;
  batch.bricks.resize(bricks.size());
  std::vector<uint32_t> order(bricks.size());
  uint64_t gaps_left = limit_bytes;
  for (uint8_t stream = 0; stream < kBrickStreams; ++stream) {
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
      return std::pair(bricks[a][stream].offset, a) < std::pair(bricks[b][stream].offset, b);
    });
    const size_t first_read = batch.reads.size();
    for (const uint32_t brick : order) {
      const Extent& extent = bricks[brick][stream];
      if (extent.length == 0) {
        batch.bricks[brick].read[stream] = BatchBrick::kNoRead;
        continue;
      }
      const uint64_t begin = pageOf(extent.offset), end = pagesEnd(extent);
      BatchRead* read = batch.reads.size() > first_read ? &batch.reads.back() : nullptr;
      const uint64_t read_end = read ? read->offset + read->length : 0;
      const uint64_t gap = begin > read_end ? begin - read_end : 0;
      if (read && gap <= std::min(kMaxGapBytes, gaps_left) &&
          std::max(end, read_end) - read->offset <= kMaxJoinedBytes) {
        gaps_left -= gap;
      } else {
        read = &batch.reads.emplace_back();
        read->stream = stream;
        read->offset = begin;
        read->first = brick;
      }
      read->length = std::max(read->length, static_cast<uint32_t>(end - read->offset));
      read->needed =
          std::max(read->needed, static_cast<uint32_t>(extent.offset + extent.length - read->offset));
      read->first = std::min(read->first, brick);
      batch.bricks[brick].read[stream] = static_cast<uint32_t>(batch.reads.size() - 1);
    }
  }

  std::vector<uint32_t> sequence(batch.reads.size()), place_of(batch.reads.size());
  std::iota(sequence.begin(), sequence.end(), 0u);
  std::stable_sort(sequence.begin(), sequence.end(),
                   [&](uint32_t a, uint32_t b) { return batch.reads[a].first < batch.reads[b].first; });
  std::vector<BatchRead> reads;
  for (const uint32_t n : sequence) {
    place_of[n] = static_cast<uint32_t>(reads.size());
    reads.push_back(batch.reads[n]);
    reads.back().place = batch.bytes;
    batch.bytes += reads.back().length;
  }
  batch.reads = std::move(reads);
  for (size_t n = 0; n < bricks.size(); ++n)
    for (size_t stream = 0; stream < kBrickStreams; ++stream) {
      BatchBrick& brick = batch.bricks[n];
      if (brick.read[stream] == BatchBrick::kNoRead) continue;
      brick.read[stream] = place_of[brick.read[stream]];
      const BatchRead& read = batch.reads[brick.read[stream]];
      brick.place[stream] = read.place + static_cast<uint32_t>(bricks[n][stream].offset - read.offset);
    }
  return batch;
}

}  // namespace curvisplat
