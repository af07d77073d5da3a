// Values of new scalars on their way into a cache that has their splats' geometry: each is a record, routed
// to the leaf brick that has its splat (ConversionOrder) through buckets of bricks, which fit in memory
// with their geometry (ValueBuckets; ValueSink writes them, ValueLoader reads them).
//
// A record takes 18 + 16 v bytes for v variables, not aligned, in the machine's own byte order:
//
//    0   node number: 47 bits, and bit 47 says "with variances"     48 bits
//    6   place of the leaf brick, in the order of conversion         32 bits
//   10   where in the brick's cell: 10 bits an axis, x lowest        32 bits
//   14   how long a0 a1 a2 are: 10 bits an axis, a0 lowest           32 bits
//   18   mean w0 w1 w2                                               4 x float a variable
//        with variances: variance                                    1 x float a variable
//
// Records begin with the node, and values are rounded, as in splat_record.h, so that sortByNode() serves
// both. Places and lengths tell whether the cache has the same splats. Unlike in conversion, the number of
// splats of each brick is known from the start, so no bucket turns out too large.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <span>
#include <vector>

#include "preprocess/convert/bucket_file.h"
#include "preprocess/convert/build_cell.h"
#include "preprocess/convert/memory_plan.h"
#include "preprocess/convert/scatter.h"
#include "preprocess/convert/splat_record.h"
#include "preprocess/convert/value_sample.h"
#include "preprocess/grid/read_ahead.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// Numbers of nodes in the whole grid: block after block, i fastest, then j, k.
class NodeNumbers {
 public:
  explicit NodeNumbers(const std::vector<BlockInfo>& blocks);

  /// The number of the first node of a run. Throws Error if the run is not in the grid.
  uint64_t firstOf(const NodeRun& run) const;
  /// The node's block and indices, for messages.
  std::string nameOf(uint64_t node) const;

 private:
  std::vector<BlockInfo> blocks_;
  std::vector<uint64_t> first_nodes_;  // [block]
};

/// A cache's octree as conversion goes through it: bricks in post-order, the order in which their streams
/// lie in the files, and the leaf brick that a node's splat is in. Immutable: any thread.
class ConversionOrder {
 public:
  /// `cache` must outlive it. Reads the geometry of leaves that share a cell, since only their nodes tell
  /// them apart.
  explicit ConversionOrder(const CacheReader& cache);

  size_t size() const { return order_.size(); }
  /// [position in the order]: the brick in the order of bricks.bin.
  uint32_t operator[](size_t position) const { return order_[position]; }
  /// The position in the order of a brick of bricks.bin.
  uint32_t positionOf(uint32_t brick) const { return positions_[brick]; }

  /// The leaf brick that holds the splat of `node` at `position`; kNoBrick if there is no cell for it.
  uint32_t leafOf(const RootPosition& position, uint64_t node) const;
  /// Whether the brick's cell is another brick's too, so that leafOf() depends on the node.
  bool sharesItsCell(uint32_t brick) const;

 private:
  void append(uint32_t brick);

  std::span<const Brick> bricks_;
  std::vector<uint32_t> order_, positions_;
  std::map<uint32_t, uint64_t> first_nodes_;  // of bricks that share their cell
};

inline constexpr int kPlaceBits = 10;

inline constexpr size_t minValueRecordBytes(size_t variables) {
  return 18 + 16 * variables;
}
inline constexpr size_t maxValueRecordBytes(size_t variables) {
  return minValueRecordBytes(variables) + 4 * variables;
}

/// The place of `position` in `cell`, which holds it: the highest kPlaceBits bits of each axis. The cell's
/// level is at most kMaxLevel.
inline std::array<uint32_t, 3> placeInCell(const RootPosition& position, const Cell& cell) {
  std::array<uint32_t, 3> place;
  for (int axis = 0; axis < 3; ++axis)
    place[axis] = static_cast<uint32_t>(position.at[axis] >> (kPositionBits - kPlaceBits - cell.level)) &
                  ((1u << kPlaceBits) - 1);
  return place;
}

/// The codes of a splat's axes, in eighths of a power of two: a code more is a length 1/16 to 1/8 larger.
std::array<uint32_t, 3> axisCodes(const Splat& splat);

/// A splat as records know it: where it lies in its brick's cell, and how long its axes are.
struct RecordedSplat {
  std::array<uint32_t, 3> place, axes;  // placeInCell(), axisCodes()
};

/// Appends a record.
void packValueRecord(uint64_t node, uint32_t brick, const RecordedSplat& splat,
                     std::span<const SplatScalar> values, std::vector<std::byte>& out);

inline uint32_t valueRecordBrick(const std::byte* record) {
  uint32_t brick = 0;
  std::memcpy(&brick, record + 6, sizeof brick);
  return brick;
}
inline RecordedSplat valueRecordSplat(const std::byte* record) {
  const auto codesAt = [&](size_t offset) -> std::array<uint32_t, 3> {
    uint32_t bits = 0;
    std::memcpy(&bits, record + offset, sizeof bits);
    constexpr uint32_t kMask = (1u << kPlaceBits) - 1;
    return {bits & kMask, bits >> kPlaceBits & kMask, bits >> (2 * kPlaceBits) & kMask};
  };
  return {codesAt(10), codesAt(14)};
}
inline size_t valueRecordBytes(const std::byte* record, size_t variables) {
  return recordIsIrregular(record) ? maxValueRecordBytes(variables) : minValueRecordBytes(variables);
}

/// Reads a record's values, one a variable.
void unpackValueRecord(const std::byte* record, std::span<SplatScalar> values);

/// Buckets of bricks that follow one another in the order of conversion, and fit in memory with the
/// geometry that the cache has of them. If there are more buckets than a file can have, each of the file's
/// holds several, and is divided when its turn comes. Immutable: any thread.
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
            uint32_t grouped, BucketFile& file, ValueSample& sample);

  /// Throws Error if the cache has no cell for the splat.
  void add(const NodeSplat& splat, std::span<const SplatScalar> values) override;
  /// Sends the records that are gathered. Call it at the end.
  void flush();

 private:
  const CacheReader* cache_;
  const ConversionOrder* order_;
  const ValueBuckets* buckets_;
  const uint32_t grouped_;
  BucketFile* file_;
  ValueSample::Adder sample_;
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

  /// How many of the buckets each number of a file takes.
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
