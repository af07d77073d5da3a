// Decoded bricks of one variable, or two, that outlive a frame, in an arena of fixed size.
//
// Invariant: every brick is charged the bytes of its 17 arrays, or 22 with a second variable; the charges and
// the holes make up the capacity; a pinned brick is never evicted. The least recently used of the others is
// evicted first, but none that was used in the current epoch (a frame, or a prefetch). If a frame needs more
// bricks than the cache holds, plain least recently used would evict each brick shortly before the next frame
// needs it, and nothing would ever be found. Here the frame's first bricks stay, and its last ones are not
// kept.
//
// Bricks are kept decoded, not packed: decoding takes two thirds of preparing a brick, and a disk delivers
// packed bricks faster than all cores decode them. bench/README.md has the figures.
//
// Any thread may use a BrickCache. The arrays of a pinned brick are read without a lock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "stream/base/mutex.h"
#include "stream/model/splats.h"

namespace curvisplat {

/// An allocator for blocks of any size in memory of a fixed size. Unlike malloc, it bounds the memory that
/// is lost to fragmentation between blocks of changing sizes. It takes the first hole that fits, and merges
/// neighbouring holes. A page that was never used takes no memory. One thread at a time.
class Arena {
 public:
  /// Blocks begin at multiples of this.
  static constexpr uint64_t kBlockAlignment = 64;

  explicit Arena(uint64_t capacity);

  /// Returns null if no hole is large enough.
  std::byte* allocate(uint64_t bytes);
  /// Frees a block. `bytes`: as given to allocate().
  void free(std::byte* block, uint64_t bytes);

  /// The memory in bytes that a block of `bytes` takes up.
  static uint64_t charge(uint64_t bytes) {
    return (bytes + kBlockAlignment - 1) / kBlockAlignment * kBlockAlignment;
  }
  uint64_t capacity() const { return capacity_; }

 private:
  struct Free {
    void operator()(std::byte* bytes) const { std::free(bytes); }
  };

  const uint64_t capacity_;
  std::unique_ptr<std::byte, Free> memory_;
  std::map<uint64_t, uint64_t> holes_;  // offset -> bytes, no two touch
};

/// The key of a decoded brick, which is kept as it is stored, or with its layers merged (LayerMerging::number).
struct BrickKey {
  uint32_t brick = 0, merging = 0;

  BrickKey(uint32_t brick_, uint32_t merging_ = 0) : brick(brick_), merging(merging_) {}
  bool operator==(const BrickKey&) const = default;
};

/// The decoded bricks. Threads find() a brick, or make a Slot for it, decode into that, and keep() it.
class BrickCache {
  struct Entry;

 public:
  explicit BrickCache(uint64_t capacity_bytes, bool two_variables = false);
  ~BrickCache();

  /// Keeps a brick in the cache. Move-only; the cache must outlive it.
  class Pin {
   public:
    Pin(Pin&& other) noexcept;
    Pin& operator=(Pin&& other) noexcept;
    ~Pin();

    GeometryArrays<const float> geometry() const;
    VariableArrays<const float> values() const;
    VariableArrays<const float> second() const;  // of two variables
    /// Calls decode(values, second) to fill the values anew if they are of an earlier step. One thread for
    /// each brick. If it throws, they stay what they were.
    template <typename Decode>
    void refresh(const Decode& decode) const {
      if (entry_->step == cache_->step_) return;
      decode(entry_->values, entry_->second);
      entry_->step = cache_->step_;
    }

   private:
    friend class BrickCache;
    Pin(BrickCache& cache, Entry& entry) : cache_(&cache), entry_(&entry) {}

    BrickCache* cache_;
    Entry* entry_;
  };

  /// Space for a brick to be decoded into. It is freed unless keep() is called.
  class Slot {
   public:
    Slot(Slot&& other) noexcept;
    Slot& operator=(Slot&&) = delete;
    ~Slot();

    const GeometryArrays<float>& geometry() const;
    const VariableArrays<float>& values() const;
    const VariableArrays<float>& second() const;
    /// Call it when the arrays are filled: find() finds the brick from now on.
    Pin keep() &&;

   private:
    friend class BrickCache;
    Slot(BrickCache& cache, Entry& entry) : cache_(&cache), entry_(&entry) {}

    BrickCache* cache_;
    Entry* entry_;
  };

  /// Begins an epoch that needs `bricks`: those in the cache count as used in it.
  void beginEpoch(const std::vector<BrickKey>& bricks);
  /// The brick, pinned and used in this epoch; nullopt if it is not in the cache.
  std::optional<Pin> find(BrickKey brick);
  /// Space for a brick that is not in the cache; evicts others if necessary. nullopt if too much is pinned
  /// or used in this epoch, or if the brick is in the cache or has a slot already.
  std::optional<Slot> makeSlot(BrickKey brick, uint32_t splats);

  bool contains(BrickKey brick) const;

  /// Says that the values of all kept bricks are of an earlier step. Their geometry stays; merged bricks are
  /// removed, since the splats that they were merged from are gone. Nothing may be pinned.
  void stepChanged();
  /// Whether the brick is here with values of an earlier step.
  bool isStale(BrickKey brick) const;

  struct Statistics {
    uint64_t hits = 0, misses = 0;  // of find()
    uint64_t evictions = 0;
    uint64_t bricks = 0, bytes = 0;  // in the cache now
    uint64_t peak_bytes = 0;
  };
  Statistics statistics() const;
  uint64_t capacity() const { return capacity_; }
  /// The bytes that a brick of `splats` splats is charged.
  static uint64_t charge(uint64_t splats, bool two_variables = false);

 private:
  struct HashOfKey {
    size_t operator()(const BrickKey& key) const {
      return std::hash<uint64_t>()(uint64_t{key.merging} << 32 | key.brick);
    }
  };
  struct Entry {
    BrickKey key{0};
    uint64_t bytes = 0, epoch = 0;
    std::byte* block = nullptr;
    GeometryArrays<float> geometry{};
    VariableArrays<float> values{}, second{};
    uint32_t pins = 0;
    bool whole = false;                    // filled: find() finds it
    uint64_t step = 0;                     // whose values it has, in the cache's count
    std::list<Entry*>::iterator unpinned;  // in unpinned_, where pins is 0
  };

  void unpin(Entry& entry) REQUIRES(mutex_);
  void remove(Entry& entry) REQUIRES(mutex_);

  const uint64_t capacity_;
  const bool two_variables_;
  mutable Mutex mutex_;  // guards the entries' pins and epochs, too
  Arena arena_ GUARDED_BY(mutex_);
  std::unordered_map<BrickKey, Entry, HashOfKey> entries_ GUARDED_BY(mutex_);
  std::list<Entry*> unpinned_ GUARDED_BY(mutex_);  // least recently used first
  uint64_t epoch_ GUARDED_BY(mutex_) = 0;
  uint64_t step_ = 0;  // counts stepChanged(), which nothing runs beside
  Statistics statistics_ GUARDED_BY(mutex_);
};

}  // namespace curvisplat
