// What happens to a bucket that turned out too large to be built in memory: it is counted and scattered again
// by finer cells or, where no cell parts its splats, by their nodes' numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/bucket_tree.h"
#include "preprocess/convert/memory_plan.h"

namespace curvisplat {

/// Where each record in `records` begins.
std::vector<uint32_t> placesOfRecords(std::span<const std::byte> records, size_t variables);

struct DividedBucket {
  std::unique_ptr<BucketFile> file;
  std::vector<uint32_t> leaves;  // of the tree, in Morton order: what the file's buckets hold
};

/// A bucket, and the leaves of the tree that have splats in it, in Morton order.
struct BucketOfLeaves {
  const BucketFile& file;
  uint32_t bucket;
  const std::vector<uint32_t>& leaves;
};

/// Splits the leaves where they hold too many splats, and scatters the bucket's records into a new file at
/// `path`. Memory: the counting grid and chunk buffers. Throws Error if a disk fails.
DividedBucket divideBucket(const BucketOfLeaves& from, size_t variables, const MemoryPlan& plan,
                           const std::filesystem::path& path, BucketTree& tree);

/// Calls `use` for each record of a bucket of any size, ordered by node. Memory: one bucket and chunk
/// buffers.
void forEachRecordByNode(const BucketFile& file, uint32_t bucket, size_t variables, const MemoryPlan& plan,
                         const std::filesystem::path& temporary_folder,
                         const std::function<void(std::span<const std::byte>)>& use);

}  // namespace curvisplat
