// The pass that makes the streams of new variables: bucket after bucket in the order of conversion, leaves in
// parallel, then the bricks above them, merged with the geometry that the cache has. What each merge is given
// is what it was given when the cache was made, so the streams have the bytes that conversion of all
// variables at once would have written.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "preprocess/addition/series_steps.h"
#include "preprocess/addition/value_buckets.h"
#include "preprocess/convert/build_cell.h"
#include "stream/base/progress.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/values_writer.h"

namespace curvisplat {

class ValueBuilder {
 public:
  /// All references must outlive it. `codings`: [variable], as many as there are.
  ValueBuilder(const CacheReader& cache, const ConversionOrder& order, const ValueBuckets& buckets,
               std::vector<ValueCoding> codings, ValuesWriter& writer, Progress& progress);
  /// Predicts from these from now on. They must outlive it.
  void predictFrom(const StepReferences& references) { references_ = &references; }

  /// Builds and appends a bucket; they come in order. Throws Error if the splats are not those of the cache.
  void build(LoadedValues& loaded);

 private:
  using Values = std::vector<std::vector<SplatScalar>>;  // [variable][splat]
  /// Bricks of one leaf cell, as far as they are in the bucket: positions, half-open.
  struct Leaf {
    uint32_t begin = 0, end = 0;
    bool is_continued = false, goes_on = false;  // has bricks in the bucket before, or after
  };
  struct Built {
    std::vector<EncodedValues> values;  // [variable]
    Values octant;                      // what it gives to its parent; of a leaf cell, its last brick has it
  };

  std::vector<Leaf> leavesOf(const LoadedValues& loaded) const;
  /// Scratch memory of a thread; kept, since it is large.
  struct Scratch {
    OctantMerger merger;
    BrickSplats brick;
    std::vector<std::vector<SplatScalar>> variables;  // of a leaf, to keep their capacity
  };

  void buildLeaf(const Leaf& leaf, LoadedValues& loaded, OctantMerger& merger, std::vector<Built>& built);
  Built buildInner(uint32_t position, const LoadedValues& loaded);
  void giveToParent(uint32_t position, Values&& octant);

  void decode(uint32_t position, const LoadedValues& loaded, BrickSplats& out) const;
  void takeValues(uint32_t position, LoadedValues& loaded, BrickSplats& brick) const;
  void encode(uint32_t position, BrickSplats& brick, Built& built) const;
  [[noreturn]] void refuse(uint32_t position, const std::string& what) const;

  const Brick& brickAt(uint32_t position) const { return cache_->bricks()[(*order_)[position]]; }
  OctantMerger newMerger() const {
    return {cache_->manifest().root, variables_, cache_->manifest().hasFeature(kMergedBorders)};
  }

  const CacheReader* cache_;
  const ConversionOrder* order_;
  const ValueBuckets* buckets_;
  const size_t variables_;
  const std::vector<ValueCoding> codings_;  // [variable]
  const NodeNumbers numbers_;
  ValuesWriter* writer_;
  const StepReferences* references_ = nullptr;
  Progress* progress_;
  // The values of inner bricks some of whose children are built: what these gave, [octant].
  std::map<uint32_t, std::array<Values, 8>> octants_;
  std::unique_ptr<OctantMerger> open_;  // of the leaf cell whose bricks go on in the next bucket
  tbb::enumerable_thread_specific<Scratch> scratch_;
};

}  // namespace curvisplat
