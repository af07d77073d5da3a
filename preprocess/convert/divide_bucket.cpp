#include "preprocess/convert/divide_bucket.h"

#include <algorithm>
#include <atomic>

#include "preprocess/convert/build_cell.h"
#include "preprocess/convert/counting_grid.h"
#include "preprocess/convert/plan_buckets.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/splat_record.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

template <typename Use>
void forEachRecord(std::span<const std::byte> records, size_t variables, Use use) {
  for (size_t at = 0; at < records.size();) {
    const size_t bytes = recordBytes(&records[at], variables);
    use(records.subspan(at, bytes));
    at += bytes;
  }
}

template <typename Use>
void forEachRecordOf(const BucketFile& file, uint32_t bucket, size_t variables, Use use) {
  file.forEachChunk(bucket, [&](std::span<const std::byte> chunk) { forEachRecord(chunk, variables, use); });
}

/// Nodes' numbers, half-open.
struct NodeRange {
  uint64_t begin, end;
};

NodeRange nodesIn(const BucketFile& file, uint32_t bucket, size_t variables) {
  NodeRange range{UINT64_MAX, 0};
  forEachRecordOf(file, bucket, variables, [&](std::span<const std::byte> record) {
    const uint64_t node = recordNode(record.data());
    range = {std::min(range.begin, node), std::max(range.end, node + 1)};
  });
  return range;
}

}  // namespace

std::vector<uint32_t> placesOfRecords(std::span<const std::byte> records, size_t variables) {
  std::vector<uint32_t> places;
  forEachRecord(records, variables, [&](std::span<const std::byte> record) {
    places.push_back(static_cast<uint32_t>(record.data() - records.data()));
  });
  return places;
}

DividedBucket divideBucket(const BucketOfLeaves& from, size_t variables, const MemoryPlan& plan,
                           const std::filesystem::path& path, BucketTree& tree) {
  CountingGrid counts(kMaxLevel, plan.counting_bytes);
  from.file.forEachChunk(from.bucket, [&](std::span<const std::byte> chunk) {
    VoxelRuns runs(counts.level());
    forEachRecord(chunk, variables,
                  [&](std::span<const std::byte> record) { runs.add(recordPosition(record.data())); });
    counts.add(runs.level(), runs.runs());
  });
  counts.close();

  DividedBucket divided;
  const size_t leaves_before = from.leaves.size();
  for (const uint32_t leaf : from.leaves) {
    const CellContents& contents = tree[leaf].contents;
    if (contents.splats > plan.plannedBucketSplats() && !contents.coincide())
      tree.split(
          leaf, [&](const Cell& cell) { return counts.count(cell); }, plan.plannedBucketSplats(),
          counts.level());
    const std::vector<uint32_t> below = tree.leavesBelow(leaf);
    divided.leaves.insert(divided.leaves.end(), below.begin(), below.end());
  }
  const auto countOf = [&](uint32_t leaf) {
    const BucketTree::Node& node = tree[leaf];
    return node.contents.splats > 0 ? node.contents.splats : counts.count(node.cell);
  };
  const uint32_t buckets =
      assignBucketsWithin(tree, divided.leaves, countOf, plan.plannedBucketSplats(), plan.most_buckets);
  CURVISPLAT_CHECK(buckets > 1 || divided.leaves.size() > leaves_before);

  divided.file = std::make_unique<BucketFile>(path, buckets, plan.chunkBytes(buckets));
  RecordRouter router(tree, *divided.file);
  forEachRecordOf(from.file, from.bucket, variables, [&](std::span<const std::byte> record) {
    router.add(record, recordPosition(record.data()));
  });
  router.flush();
  divided.file->close();
  tree.setContents(divided.leaves, router.contents());
  return divided;
}

void forEachRecordByNode(const BucketFile& file, uint32_t bucket, size_t variables, const MemoryPlan& plan,
                         const std::filesystem::path& temporary_folder,
                         const std::function<void(std::span<const std::byte>)>& use) {
  if (file.bytes(bucket) <= plan.bucket_bytes) {
    std::vector<std::byte> bytes;
    file.read(bucket, bytes);
    std::vector<uint32_t> places = placesOfRecords(bytes, variables);
    const RecordSpan records{bytes.data(), places};
    sortByNode(records);
    for (size_t n = 0; n < records.size(); ++n) use({records[n], recordBytes(records[n], variables)});
    return;
  }
  static std::atomic<unsigned> files_made = 0;
  const NodeRange nodes = nodesIn(file, bucket, variables);
  const uint64_t wanted = 2 * (file.bytes(bucket) / plan.bucket_bytes + 1);
  const auto parts =
      static_cast<uint32_t>(std::min<uint64_t>({wanted, plan.most_buckets, nodes.end - nodes.begin}));
  const uint64_t nodes_a_part = (nodes.end - nodes.begin + parts - 1) / parts;
  BucketFile by_node(temporary_folder / fmt::format("by_node{}.bin", files_made++), parts,
                     plan.chunkBytes(parts));
  forEachRecordOf(file, bucket, variables, [&](std::span<const std::byte> record) {
    by_node.append(static_cast<uint32_t>((recordNode(record.data()) - nodes.begin) / nodes_a_part), record);
  });
  by_node.close();
  for (uint32_t part = 0; part < parts; ++part)
    forEachRecordByNode(by_node, part, variables, plan, temporary_folder, use);
}

}  // namespace curvisplat
