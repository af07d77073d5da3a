// The temporary data of conversion: records, the file they lie in, the cells they belong to, memory.
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>

#include "preprocess/convert/bucket_builds.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_plan.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/splat_record.h"
#include "stream/base/error.h"
#include "stream/model/octree.h"
#include "tests/support/expect_error.h"
#include "tests/support/faulty_system_calls.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

NodeSplat someSplat(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(0.1, 1);
  NodeSplat splat;
  splat.node = random() >> 17;
  for (double& axis : splat.splat.axis) axis = unit(random);
  for (double& shear : splat.splat.shear) shear = unit(random) - 0.5;
  splat.splat.weight = splat.splat.axis[0] * splat.splat.axis[1] * splat.splat.axis[2];
  return splat;
}

TEST(SplatRecord, RoundTripsToSinglePrecision) {
  std::mt19937_64 random(1);
  std::vector<std::byte> record;
  for (int n = 0; n < 200; ++n) {
    NodeSplat splat = someSplat(random);
    splat.regular = n % 2 == 0;
    if (n % 4 == 0) splat.splat.weight *= 0.75;
    if (!splat.regular) {
      splat.splat.weight *= 3;
      splat.border_code = 0x12345601;
    }
    std::vector<SplatScalar> values{{0.25, {1, 2, 3}, 0}, {-7, {0.5, 0, -1}, 0}};
    if (!splat.regular) values[1].variance = 0.125;
    if (n % 3 == 0) splat.growth_code = 0x1234567;
    const RootPosition position{{random() >> 16, random() >> 16, random() >> 16}};
    record.clear();
    packRecord(splat, values, position, record);
    ASSERT_EQ(record.size(), splat.regular ? 83u : 99u);
    EXPECT_EQ(recordBytes(record.data(), 2), record.size());
    EXPECT_EQ(recordNode(record.data()), splat.node);
    EXPECT_EQ(recordPosition(record.data()), position);
    Splat back;
    std::vector<SplatScalar> values_back(2);
    const SplatCodes codes = unpackRecord(record.data(), back, values_back);
    EXPECT_EQ(codes.border, splat.border_code);
    EXPECT_EQ(codes.growth, splat.growth_code);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(back.axis[axis], splat.splat.axis[axis], 8e-6 * splat.splat.axis[axis]);
      EXPECT_FLOAT_EQ(back.shear[axis], splat.splat.shear[axis]);
    }
    EXPECT_NEAR(back.weight, splat.splat.weight, 4.5e-5 * splat.splat.weight);
    for (int v = 0; v < 2; ++v) {
      EXPECT_EQ(values_back[v].mean, values[v].mean);
      EXPECT_EQ(values_back[v].slope, values[v].slope);
      EXPECT_EQ(values_back[v].variance, values[v].variance);
    }
  }
}

TEST(SplatRecord, KeepsEveryNumberFinite) {
  NodeSplat splat;
  splat.regular = false;
  splat.splat.axis = {1e-60, 1e60, 1};
  splat.splat.weight = 0;
  const std::vector<SplatScalar> values{{1e300, {-1e300, 0, 0}, 1e300}};
  std::vector<std::byte> record;
  packRecord(splat, values, {}, record);
  Splat back;
  std::vector<SplatScalar> values_back(1);
  unpackRecord(record.data(), back, values_back);
  EXPECT_GT(back.axis[0], 0);
  EXPECT_TRUE(std::isfinite(back.axis[1]));
  EXPECT_EQ(back.axis[2], 1);
  EXPECT_EQ(back.weight, 0);
  EXPECT_TRUE(std::isfinite(values_back[0].mean) && std::isfinite(values_back[0].variance));
}

TEST(BucketFile, GivesBackEachBucketsRecordsWhoeverWroteThem) {
  const TemporaryFolder folder;
  constexpr uint32_t kBuckets = 7, kRecords = 20000;
  BucketFile file(folder / "buckets.bin", kBuckets, 4096);
  tbb::parallel_for(uint32_t{0}, kRecords, [&](uint32_t n) {
    const std::array<uint32_t, 2> record{n, ~n};
    if (n % kBuckets != 3) file.append(n % kBuckets, std::as_bytes(std::span(record)));
  });
  file.close();
  for (uint32_t bucket = 0; bucket < kBuckets; ++bucket) {
    std::vector<std::byte> bytes;
    file.read(bucket, bytes);
    EXPECT_EQ(bytes.size(), file.bytes(bucket));
    std::multiset<uint32_t> found, in_chunks, expected;
    for (size_t at = 0; at < bytes.size(); at += 8) {
      std::array<uint32_t, 2> record;
      std::memcpy(&record, &bytes[at], 8);
      ASSERT_EQ(record[0], ~record[1]);
      found.insert(record[0]);
    }
    file.forEachChunk(bucket, [&](std::span<const std::byte> chunk) {
      for (size_t at = 0; at < chunk.size(); at += 8) {
        uint32_t first;
        std::memcpy(&first, &chunk[at], 4);
        in_chunks.insert(first);
      }
    });
    for (uint32_t n = bucket; n < kRecords && bucket != 3; n += kBuckets) expected.insert(n);
    EXPECT_EQ(found, expected);
    EXPECT_EQ(in_chunks, expected);
  }
}

TEST(BucketFile, HasAllRecordsInChainsOfEqualLength) {
  const TemporaryFolder folder;
  BucketFile file(folder / "buckets.bin", 2, 4096);
  std::vector<std::byte> record(4000);
  for (int n = 0; n < 4 * 5; ++n) {
    record[0] = static_cast<std::byte>(n);
    file.append(1, record);
  }
  file.close();
  std::set<int> found;
  for (size_t chain = 0; chain < BucketChains::kCount; ++chain) {
    int chunks = 0;
    file.forEachChunk(1, chain, [&](std::span<const std::byte> chunk) {
      found.insert(static_cast<int>(chunk[0]));
      ++chunks;
    });
    EXPECT_EQ(chunks, 5);
  }
  EXPECT_EQ(found.size(), 20u);
  file.forEachChunk(0, [](std::span<const std::byte>) { FAIL(); });
}

/// A tree of 64 leaves in buckets, and a file with random records of its cells.
struct BucketsOfTree {
  explicit BucketsOfTree(const TemporaryFolder& folder) : path(folder / "buckets.bin") {
    tree.split(
        0, [](const Cell& cell) { return cell.level < 2 ? 1000u : 10u; }, 100, 24);
    const std::vector<uint32_t> leaves = tree.leavesBelow(0);
    const uint32_t buckets = tree.assignBuckets(
        leaves, [](uint32_t) { return 10u; }, 300);
    file = std::make_unique<BucketFile>(path, buckets, 4096);
    std::mt19937_64 random(7);
    std::vector<CellContents> contents(tree.size());
    std::vector<std::byte> record;
    for (int n = 0; n < 20'000; ++n) {
      NodeSplat splat = someSplat(random);
      splat.regular = n % 3 != 0;
      const RootPosition position{{random() >> 16, random() >> 16, random() >> 16}};
      record.clear();
      packRecord(splat, kValues, position, record);
      const uint32_t leaf = tree.leafOf(position);
      // More than a brick each, so that no leaves are built together.
      contents[leaf].add(position);
      contents[leaf].splats += kMaxBrickSplats;
      file->append(tree[leaf].bucket, record);
      expected[leaf].insert(splat.node);
    }
    file->close();
    tree.setContents(leaves, contents);
  }

  static const inline std::vector<SplatScalar> kValues{{0.25, {1, 2, 3}, 0}};
  const std::filesystem::path path;
  BucketTree tree;
  std::unique_ptr<BucketFile> file;
  std::map<uint32_t, std::multiset<uint64_t>> expected;  // nodes by leaf
};

TEST(BucketLoader, GroupsAllRecordsByCellsForAnyNumberOfReaders) {
  const TemporaryFolder folder;
  BucketsOfTree buckets(folder);
  ASSERT_GT(buckets.file->buckets(), 1u);
  for (const unsigned readers : {1u, 2u, 3u, 4u}) {
    SCOPED_TRACE(readers);
    BucketLoader loader(buckets.tree, *buckets.file, 1, {0, buckets.file->buckets()}, 1 << 30, readers);
    std::map<uint32_t, std::multiset<uint64_t>> found;
    while (LoadedBucket* const loaded = loader.acquire()) {
      size_t placed = 0;
      for (size_t n = 0; n < loaded->parts.size(); ++n) {
        const LoadedBucket::Part& part = loaded->parts[n];
        EXPECT_EQ(part.begin, placed);
        placed += part.count;
        const RecordSpan records = loaded->records(part);
        for (size_t r = 0; r < records.size(); ++r) {
          EXPECT_EQ(buckets.tree.leafOf(recordPosition(records[r])), part.unit);
          found[part.unit].insert(recordNode(records[r]));
        }
        if (n > 0) {
          const auto first = [&](uint32_t unit) {
            const Cell& cell = buckets.tree[unit].cell;
            return Cell{2, cell.at};
          };
          EXPECT_TRUE(mortonLess(first(loaded->parts[n - 1].unit), first(part.unit)));
        }
      }
      EXPECT_EQ(placed, loaded->places.size());
      loader.giveBack();
    }
    EXPECT_EQ(found, buckets.expected);
  }
}

TEST(BucketLoader, ReportsDamageWhicheverReaderFindsIt) {
  const TemporaryFolder folder;
  const BucketsOfTree buckets(folder);
  const BucketChains chains = buckets.file->chains();
  for (const uint64_t chunk : chains.chains.front().last_chunks) {
    ASSERT_NE(chunk, BucketChains::kNoChunk);
    const auto change = [&] {
      std::fstream file(buckets.path, std::ios::binary | std::ios::in | std::ios::out);
      file.seekg(static_cast<std::streamoff>(chunk + 100));
      const char changed = static_cast<char>(file.get() ^ 1);
      file.seekp(static_cast<std::streamoff>(chunk + 100));
      file.put(changed);
    };
    BucketFile foreign(buckets.path, chains);
    foreign.leave();
    change();
    BucketLoader loader(buckets.tree, foreign, 1, {0, foreign.buckets()}, 1 << 30, 4);
    EXPECT_THROW(while (loader.acquire()) loader.giveBack(), LostBuckets);
    change();
  }
}

TEST(BucketFile, IsGoneAfterwards) {
  const TemporaryFolder folder;
  { const BucketFile file(folder / "buckets.bin", 1, 4096); }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(BucketFile, ReportsAFullDisk) {
  const TemporaryFolder folder;
  faults::FaultySystemCalls disk;
  disk.fail_write_at = 5;
  const ScopedSystemCalls scope(disk);
  BucketFile file(folder / "buckets.bin", 2, 4096);
  const std::vector<std::byte> record(1000);
  EXPECT_THROW(
      {
        for (int n = 0; n < 1000; ++n) file.append(n % 2, record);
        file.close();
      },
      Error);
}

TEST(BucketTree, SplitsFullCellsAndFindsTheLeafOfAPosition) {
  const auto count = [](const Cell& cell) -> uint64_t {
    return cell.at == std::array<uint32_t, 3>{0, 0, 0} ? 1000 >> cell.level : 1;
  };
  BucketTree tree;
  tree.split(0, count, 100, 24);
  const std::vector<uint32_t> leaves = tree.leavesBelow(0);
  EXPECT_EQ(leaves.size(), 4 * 7 + 1u);  // 1000, 500, 250 and 125 are split; 62 is not
  EXPECT_EQ(tree[leaves.front()].cell.level, 4u);
  std::mt19937_64 random(5);
  for (int n = 0; n < 1000; ++n) {
    const RootPosition position{{random() >> (16 + n % 8), random() >> (16 + n % 8), random() >> 16}};
    const uint32_t leaf = tree.leafOf(position);
    EXPECT_TRUE(tree[leaf].isLeaf());
    EXPECT_TRUE(tree[leaf].cell.contains(position));
  }
  for (size_t n = 1; n < leaves.size(); ++n) {
    RootPosition before, after;
    for (int axis = 0; axis < 3; ++axis) {
      before.at[axis] = uint64_t{tree[leaves[n - 1]].cell.at[axis]} << (48 - tree[leaves[n - 1]].cell.level);
      after.at[axis] = uint64_t{tree[leaves[n]].cell.at[axis]} << (48 - tree[leaves[n]].cell.level);
    }
    EXPECT_TRUE(mortonLess(Cell::of(before, 24), Cell::of(after, 24)));
  }
}

TEST(BucketTree, BucketsShareUpToTheCapacity) {
  BucketTree tree;
  tree.split(
      0, [](const Cell& cell) { return cell.level < 2 ? 1000u : 10u; }, 100, 24);
  const auto leaves = tree.leavesBelow(0);
  const uint32_t buckets = tree.assignBuckets(
      leaves, [](uint32_t) { return 10u; }, 100);
  EXPECT_EQ(buckets, 7u);  // 64 leaves, ten a bucket
  uint32_t last = 0;
  for (const uint32_t leaf : leaves) {
    EXPECT_TRUE(tree[leaf].bucket == last || tree[leaf].bucket == last + 1);
    last = tree[leaf].bucket;
  }
}

TEST(BucketTree, ContentsSumUpwards) {
  BucketTree tree;
  tree.split(
      0, [](const Cell& cell) { return cell.level == 0 ? 1000u : 10u; }, 100, 24);
  std::vector<CellContents> contents(tree.size());
  const RootPosition low{{0, 0, 0}}, high{{(1ull << 48) - 1, 5, 7}};
  contents[tree.leafOf(low)].add(low);
  contents[tree.leafOf(high)].add(high);
  contents[tree.leafOf(high)].add(high);
  tree.setContents(tree.leavesBelow(0), contents);
  EXPECT_EQ(tree[0].contents.splats, 3u);
  EXPECT_EQ(tree[0].contents.lower, low);
  EXPECT_EQ(tree[0].contents.upper, high);
  EXPECT_FALSE(tree[0].contents.coincide());
  EXPECT_TRUE(tree[tree.leafOf(high)].contents.coincide());
}

TEST(MemoryPlan, StaysWithinTheCap) {
  for (const size_t variables : {size_t{0}, size_t{1}, size_t{5}}) {
    for (const unsigned threads : {1u, 2u, 16u, 256u}) {
      for (uint64_t cap = leastMemory(variables); cap < uint64_t{64} << 30; cap *= 2) {
        const MemoryPlan plan = MemoryPlan::of(cap, variables, threads);
        EXPECT_GE(plan.threads, 1u);
        EXPECT_LE(plan.threads, threads);
        EXPECT_GE(plan.bucket_splats, 4 * 65536u);
        const uint64_t scan = 2 * plan.slab_bytes + plan.counting_bytes;
        const uint64_t scatter = 2 * plan.slab_bytes + plan.chunk_buffer_bytes + plan.seam_bytes;
        const uint64_t build = 2 * (plan.bucket_bytes + 4 * plan.bucket_splats);
        EXPECT_LT(std::max({scan, scatter, build}), cap);
        EXPECT_LE(plan.most_buckets * plan.chunkBytes(plan.most_buckets), plan.chunk_buffer_bytes);
      }
    }
  }
}

TEST(MemoryPlan, SuitsTheGrid) {
  constexpr uint64_t kMiB = uint64_t{1} << 20;
  const MemoryPlan whole = MemoryPlan::of(uint64_t{2} << 30, 1, 2);
  MemoryPlan small = whole, large = whole;
  small.suit(6'400'000, 1);
  large.suit(500'000'000, 1);
  EXPECT_EQ(small.slab_bytes, 48 * kMiB);
  EXPECT_EQ(small.bucket_splats, 1'600'000u);
  EXPECT_EQ(small.bucket_bytes, 1'600'000 * regularRecordBytes(1));
  EXPECT_EQ(large.slab_bytes, whole.slab_bytes);
  EXPECT_EQ(large.bucket_splats, whole.bucket_splats);
  // A small grid keeps many threads busy, and nothing grows beyond what fits.
  MemoryPlan of_many = MemoryPlan::of(uint64_t{4} << 30, 1, 16), least = MemoryPlan::of(leastMemory(1), 1, 1);
  of_many.suit(6'400'000, 1);
  EXPECT_EQ(of_many.bucket_splats, 16 * 10 * 65536u);
  const uint64_t least_slab = least.slab_bytes, least_bucket = least.bucket_splats;
  least.suit(500'000'000, 1);
  EXPECT_EQ(least.slab_bytes, least_slab);
  EXPECT_EQ(least.bucket_splats, least_bucket);
}

TEST(MemoryPlan, LeavesMemoryForALargeIndex) {
  constexpr uint64_t kSamples = 10'000'000'000;
  const MemoryPlan whole = MemoryPlan::of(uint64_t{1} << 30, 1, 2);
  MemoryPlan large = whole;
  large.suit(kSamples, 1);
  // At least the records of the bricks that full leaves make, with an eighth for those above.
  const uint64_t index = kSamples / 65536 * 9 / 8 * (sizeof(Brick) + sizeof(double) + sizeof(BrickVariable));
  EXPECT_LE(2 * large.bucket_bytes + index, 2 * whole.bucket_bytes);
  EXPECT_LE(large.expectedPeak(kSamples, 1), uint64_t{1} << 30);
  // Too small a limit is refused, and the one that is named suffices for any number of threads.
  for (const unsigned threads : {1u, 16u}) {
    MemoryPlan small = MemoryPlan::of(leastMemory(1), 1, threads);
    const std::string message = errorOf([&] { small.suit(kSamples, 1); }), before = "at least ";
    ASSERT_NE(message.find(before), std::string::npos);
    const uint64_t least = std::stoull(message.substr(message.find(before) + before.size())) << 20;
    MemoryPlan enough = MemoryPlan::of(least, 1, threads);
    EXPECT_NO_THROW(enough.suit(kSamples, 1));
    EXPECT_GE(enough.bucket_splats, 4 * 65536u);
    MemoryPlan less = MemoryPlan::of(least - (uint64_t{8} << 20), 1, threads);
    EXPECT_THROW(less.suit(kSamples, 1), Error);
  }
}

TEST(MemoryPlan, RefusesLessThanTheLeast) {
  EXPECT_THROW(MemoryPlan::of(leastMemory(1) - 1, 1, 1), Error);
  for (const uint64_t seams : {uint64_t{100} << 20, uint64_t{3} << 30}) {
    const uint64_t cap = MemoryPlan::capForSeams(seams);
    EXPECT_GE(MemoryPlan::of(cap, 1, 1).seam_bytes, seams);
    EXPECT_LT(MemoryPlan::of(cap - 4096, 1, 1).seam_bytes, seams);
  }
  EXPECT_LE(leastMemory(1), uint64_t{256} << 20);
}

}  // namespace
}  // namespace curvisplat
