#include "preprocess/addition/drawn_nodes.h"

#include <algorithm>
#include <cstring>

#include "preprocess/addition/conversion_order.h"
#include "preprocess/convert/bucket_file.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

struct RunRecord {
  uint64_t first, count;
};

/// Nodes of a bucket: their bits take this many bytes, or more where that would make too many buckets.
constexpr uint64_t kBucketBytes = 4 << 20;
constexpr size_t kPieceBytes = 64 << 10;

}  // namespace

DrawnNodes::DrawnNodes(const CacheReader& cache, const MemoryPlan& plan,
                       const std::filesystem::path& temporary_folder, Progress& progress)
    : written_(temporary_folder / "drawn.bin"), bits_(written_.path()) {
  const Manifest& manifest = cache.manifest();
  uint64_t nodes = 0;  // of the blocks, also where splats stand for cells
  for (const BlockInfo& block : manifest.blocks) nodes += block.ni * block.nj * block.nk;
  const uint64_t bytes = (nodes + 7) / 8;
  const uint64_t bucket_bytes = std::max(kBucketBytes, bytes / plan.most_buckets + 1);
  const uint64_t bucket_nodes = 8 * bucket_bytes;
  const auto buckets = static_cast<uint32_t>((bytes + bucket_bytes - 1) / bucket_bytes);
  BucketFile runs_file(temporary_folder / "runs.bin", buckets, plan.chunkBytes(buckets));

  const NodeNumbers numbers(manifest.blocks);
  SplatGeometry geometry;
  std::vector<NodeRun> runs;
  for (uint32_t brick = 0; brick < cache.bricks().size(); ++brick) {
    progress.advance(1);
    if (!cache.bricks()[brick].isLeaf()) continue;
    cache.readGeometry(brick, geometry, &runs);
    for (const NodeRun& run : runs) {
      RunRecord record{numbers.firstOf(run), run.count};
      while (record.count > 0) {
        const uint64_t bucket = record.first / bucket_nodes;
        const RunRecord part{record.first,
                             std::min(record.count, (bucket + 1) * bucket_nodes - record.first)};
        runs_file.append(static_cast<uint32_t>(bucket), std::as_bytes(std::span(&part, 1)));
        record = {part.first + part.count, record.count - part.count};
      }
    }
  }
  runs_file.close();

  std::vector<uint8_t> bits;
  for (uint32_t bucket = 0; bucket < buckets; ++bucket) {
    bits.assign(std::min(bucket_bytes, bytes - bucket * bucket_bytes), 0);
    runs_file.forEachChunk(bucket, [&](std::span<const std::byte> chunk) {
      for (size_t at = 0; at < chunk.size(); at += sizeof(RunRecord)) {
        RunRecord record;
        std::memcpy(&record, &chunk[at], sizeof record);
        for (uint64_t n = 0; n < record.count; ++n) {
          const uint64_t bit = record.first + n - bucket * bucket_nodes;
          bits[bit / 8] |= static_cast<uint8_t>(1u << (bit % 8));
        }
      }
    });
    written_.append(std::span<const uint8_t>(bits));
  }
}

DrawnNodes::~DrawnNodes() {
  removeAll(written_.path());
}

bool DrawnNodes::holds(uint64_t node) const {
  uint8_t bits = 0;
  bits_.readAt(node / 8, std::span(&bits, 1));
  return (bits >> (node % 8) & 1) != 0;
}

void DrawnNodes::add(uint64_t node) {
  uint8_t bits = 0;
  bits_.readAt(node / 8, std::span(&bits, 1));
  bits |= static_cast<uint8_t>(1u << (node % 8));
  written_.writeAt(node / 8, std::as_bytes(std::span(&bits, 1)));
}

void DrawnNodes::blankOthers(uint64_t first, std::span<uint8_t> blank) const {
  std::vector<uint8_t> bits;
  for (size_t done = 0; done < blank.size();) {
    const uint64_t begin = first + done;
    const size_t count = std::min<size_t>(blank.size() - done, 8 * kPieceBytes);
    bits.resize((begin + count + 7) / 8 - begin / 8);
    bits_.readAt(begin / 8, std::span(bits));
    for (size_t n = 0; n < count; ++n) {
      const size_t bit = begin % 8 + n;
      blank[done + n] |= ~bits[bit / 8] >> (bit % 8) & 1;
    }
    done += count;
  }
}

}  // namespace curvisplat
