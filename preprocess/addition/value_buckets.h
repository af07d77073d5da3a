// Records of new values on their way to their bricks: buckets of bricks that follow one another in the order
// of conversion, and fit in memory with the geometry that the cache has of them.
//
// Unlike in conversion, what each brick will get is known from the start, so no bucket turns out too large.
// If there are more buckets than a file can have, each of the file's holds several, and is divided when its
// turn comes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "preprocess/addition/conversion_order.h"
#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/build_cell.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/grid/read_ahead.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"

namespace curvisplat {

class ValueBuckets {
 public:
  /// Bricks are taken together while what building takes of them stays within `most_bytes`.
  ValueBuckets(std::span<const Brick> bricks, const ConversionOrder& order, size_t variables,
               uint64_t most_bytes);

  uint32_t size() const { return static_cast<uint32_t>(begins_.size() - 1); }
  /// Positions in the order of conversion, half-open.
  uint32_t begin(uint32_t bucket) const { return begins_[bucket]; }
  uint32_t end(uint32_t bucket) const { return begins_[bucket + 1]; }
  /// The bucket of a brick at `position`.
  uint32_t of(uint32_t position) const;

 private:
  std::vector<uint32_t> begins_;  // of all buckets, and the end
};

/// Packs splats' values and sends them to their bricks' buckets: bucket n goes to number n / `grouped` of
/// `file`. One a thread.
class ValueSink : public SplatSink {
 public:
  /// All references must outlive it.
  ValueSink(const CacheReader& cache, const ConversionOrder& order, const ValueBuckets& buckets,
            uint32_t grouped, BucketFile& file);

  /// Throws Error if the cache has no cell for the splat.
  void add(const NodeSplat& splat, std::span<const SplatScalar> values) override;
  /// Sends what is gathered. To be called at the end.
  void flush();

 private:
  const CacheReader* cache_;
  const ConversionOrder* order_;
  const ValueBuckets* buckets_;
  const uint32_t grouped_;
  BucketFile* file_;
  uint32_t leaf_ = kNoBrick;
  bool leaf_shares_ = false;
  uint32_t number_ = 0;  // of the leaf's bucket, in the file
  std::vector<std::byte> gathered_;
};

/// A bucket in memory.
struct LoadedValues {
  uint32_t bucket = 0;
  uint32_t first = 0;                // position of its first brick
  std::vector<std::byte> bytes;      // of the records
  std::vector<uint32_t> places;      // of the records, brick after brick
  std::vector<size_t> begins;        // [brick of the bucket]: in `places`; and the end
  std::vector<std::byte> geometry;   // streams, brick after brick
  std::vector<uint64_t> geometries;  // [brick of the bucket]: in `geometry`; and the end

  RecordSpan records(uint32_t position) {
    const uint32_t n = position - first;
    return {bytes.data(), std::span(places).subspan(begins[n], begins[n + 1] - begins[n])};
  }
  std::span<const std::byte> geometryOf(uint32_t position) const {
    const uint32_t n = position - first;
    return std::span(geometry).subspan(geometries[n], geometries[n + 1] - geometries[n]);
  }
};

/// Calls `use` for buckets [begin, end), in order, reading one ahead. `file` has `grouped` buckets a number,
/// from `begin` on. Memory: two buckets, or a divided file's chunk buffers. Throws Error if a disk fails.
class ValueLoader {
 public:
  ValueLoader(const CacheReader& cache, const ConversionOrder& order, const ValueBuckets& buckets,
              size_t variables, const MemoryPlan& plan, std::filesystem::path temporary_folder);

  void forEach(const BucketFile& file, uint32_t begin, uint32_t end, uint32_t grouped,
               const std::function<void(LoadedValues&)>& use);

  /// How many buckets each number of a file takes, of so many.
  static uint32_t grouping(uint32_t buckets, const MemoryPlan& plan) {
    return (buckets + plan.most_buckets - 1) / plan.most_buckets;
  }

 private:
  void load(const BucketFile& file, uint32_t number, uint32_t bucket, LoadedValues& out) const;
  void divide(const BucketFile& file, uint32_t number, uint32_t begin, uint32_t end,
              const std::function<void(LoadedValues&)>& use);

  const CacheReader* cache_;
  const ConversionOrder* order_;
  const ValueBuckets* buckets_;
  const size_t variables_;
  const MemoryPlan plan_;
  const std::filesystem::path temporary_folder_;
  InputFile geometry_;
  unsigned files_made_ = 0;
};

}  // namespace curvisplat
