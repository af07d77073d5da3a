// Decoded values of bricks at some steps of a series, so that the steps which are predicted from them, or lie between
// them, need not decode them again.
//
// Invariant: what is kept takes at most the capacity; the least recently used goes first. Values that a caller
// still holds live on without being counted: a brick a thread. Any thread.
#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <memory>

#include "stream/base/mutex.h"
#include "stream/model/splats.h"

namespace curvisplat {

class KeptValues {
 public:
  using Values = std::shared_ptr<const SplatVariable>;
  struct Key {
    uint64_t step = 0;
    size_t variable = 0;
    uint32_t brick = 0;
    auto operator<=>(const Key&) const = default;
  };

  /// With 0 it keeps nothing.
  explicit KeptValues(uint64_t capacity_bytes) : capacity_(capacity_bytes) {}

  uint64_t capacity() const { return capacity_; }
  /// nullptr if they are not kept.
  Values find(const Key& key);
  /// Keeps values that fit, unless it has those of the key.
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

}  // namespace curvisplat
