// Decoded values of a series: those of bricks at some steps, which are kept for other steps that are
// predicted from them or lie between them, and those between two steps of one geometry, for a reader of a
// time that no step has.
//
// Invariant: kept values take at most the capacity; the least recently used ones are dropped first. Values
// that a caller still holds live on without being counted, which is one brick per thread. Any thread may use
// KeptValues and call the functions.
#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <memory>

#include "stream/base/mutex.h"
#include "stream/model/octree.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// The decoded values of the most recently used bricks and steps.
class KeptValues {
 public:
  using Values = std::shared_ptr<const SplatVariable>;
  struct Key {
    uint64_t step = 0;
    size_t variable = 0;
    uint32_t brick = 0;
    auto operator<=>(const Key&) const = default;
  };

  /// A capacity of 0 keeps nothing.
  explicit KeptValues(uint64_t capacity_bytes) : capacity_(capacity_bytes) {}

  uint64_t capacity() const { return capacity_; }
  /// The values of the key; nullptr if they are not kept.
  Values find(const Key& key);
  /// Keeps `values` if they fit and there are none of the key yet.
  void keep(const Key& key, Values values);

  struct Statistics {
    uint64_t hits = 0, misses = 0;  // of find()
    uint64_t bytes = 0, peak_bytes = 0;
  };
  Statistics statistics() const;
  /// The bytes that a brick of `splats` splats is charged.
  static uint64_t charge(uint64_t splats);

 private:
  struct Entry {
    Values values;
    std::list<Key>::iterator used;
  };

  const uint64_t capacity_;
  mutable Mutex mutex_;
  std::map<Key, Entry> entries_ GUARDED_BY(mutex_);
  std::list<Key> used_ GUARDED_BY(mutex_);  // least recently first
  Statistics statistics_ GUARDED_BY(mutex_);
};

/// Replaces `values`, those of the earlier step, by those at `part` (0 to 1) of the way to `later`.
///
/// A splat's mean f and slope h are linear in the samples, so their blend is what a splat of blended samples
/// has. The square root of the variance is blended too: that is exact where the deviations of the two steps
/// go together, and an upper bound otherwise, since samples that move against each other have a smaller
/// variance.
void blendValues(const VariableArrays<float>& values, const VariableArrays<const float>& later, double part);

/// The record of a brick between two steps: bounds of its blended values, and the stream of the earlier
/// step.
BrickVariable blendedRecord(const BrickVariable& earlier, const BrickVariable& later, double part);

}  // namespace curvisplat
