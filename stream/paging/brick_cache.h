// Decoded bricks of one variable that outlive a frame, in an arena of fixed size.
//
// Invariant: every brick is charged the bytes of its 16 arrays; the charges and the holes make up the
// capacity; a pinned brick is never thrown out. Of the others the least recently used goes first, but none
// that was used in the current turn (a frame, or a prefetch): drawing more than the cache holds would
// otherwise throw out each brick shortly before it is wanted again, and a cache of half the size would hit
// nothing. So the first bricks of such a frame stay and its last ones are not kept.
//
// What is kept is decoded, not packed: decoding takes two thirds of preparing a brick, and a disk delivers
// packed bricks faster than all cores decode them. bench/README.md has the figures.
//
// Any thread. The arrays of a pinned brick are read without a lock.
#pragma once

#include <atomic>
#include <cstdint>
#include <list>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <vector>

#include "stream/model/splats.h"
#include "stream/paging/arena.h"

namespace curvisplat {

class BrickCache {
  struct Entry;

 public:
  explicit BrickCache(uint64_t capacity_bytes);
  ~BrickCache();

  /// Keeps a brick where it is. Move-only; outlived by the cache.
  class Pin {
   public:
    Pin(Pin&& other) noexcept;
    Pin& operator=(Pin&& other) noexcept;
    ~Pin();

    GeometryArrays<const float> geometry() const;
    VariableArrays<const float> values() const;
    /// Calls `decode` to fill the values anew if they are of an earlier step; others who want that wait. If it
    /// throws, they stay what they were.
    template <typename Decode>
    void refresh(const Decode& decode) const {
      const std::lock_guard lock(entry_->refreshing);
      if (entry_->step == cache_->step_) return;
      decode(entry_->values);
      entry_->step = cache_->step_;
    }

   private:
    friend class BrickCache;
    Pin(BrickCache& cache, Entry& entry) : cache_(&cache), entry_(&entry) {}

    BrickCache* cache_;
    Entry* entry_;
  };

  /// Space for a brick, to be decoded into. Dropped without keep(), it is as if it had never been.
  class Room {
   public:
    Room(Room&& other) noexcept;
    Room& operator=(Room&&) = delete;
    ~Room();

    const GeometryArrays<float>& geometry() const;
    const VariableArrays<float>& values() const;
    /// The arrays are filled: the brick can be found from now on.
    Pin keep() &&;

   private:
    friend class BrickCache;
    Room(BrickCache& cache, Entry& entry) : cache_(&cache), entry_(&entry) {}

    BrickCache* cache_;
    Entry* entry_;
  };

  /// Begins a turn in which `bricks` are wanted: those that are here count as used in it.
  void beginTurn(const std::vector<uint32_t>& bricks);
  /// The brick, if it is here; used from now on.
  std::optional<Pin> find(uint32_t brick);
  /// Space for a brick that is not here, thrown out of others if need be. Nothing where too much is pinned or
  /// of this turn, or where the brick is here or being made.
  std::optional<Room> makeRoom(uint32_t brick, uint32_t splats);

  bool contains(uint32_t brick) const;

  /// From now on the values of bricks that are here are of an earlier step; their geometry stays. Nothing may be
  /// pinned.
  void stepChanged();
  /// Whether the brick is here with values of an earlier step.
  bool isStale(uint32_t brick) const;

  struct Statistics {
    uint64_t hits = 0, misses = 0;  // of find()
    uint64_t evictions = 0;
    uint64_t bricks = 0, bytes = 0;  // here now
    uint64_t peak_bytes = 0;
  };
  Statistics statistics() const;
  uint64_t capacity() const { return arena_.capacity(); }
  /// What a brick is charged.
  static uint64_t charge(uint64_t splats);

 private:
  struct Entry {
    uint32_t brick = 0;
    uint64_t bytes = 0, turn = 0;
    std::byte* block = nullptr;
    GeometryArrays<float> geometry{};
    VariableArrays<float> values{};
    uint32_t pins = 0;
    bool whole = false;                    // can be found
    mutable std::mutex refreshing;         // guards step, and the values while they are filled anew
    uint64_t step = 0;                     // whose values it has, in the cache's count
    std::list<Entry*>::iterator unpinned;  // in unpinned_, where pins is 0
  };

  void unpin(Entry& entry);
  void remove(Entry& entry);

  mutable std::mutex mutex_;  // guards all below, and the entries' pins and turns
  Arena arena_;
  std::unordered_map<uint32_t, Entry> entries_;
  std::list<Entry*> unpinned_;  // least recently used first
  uint64_t turn_ = 0;
  std::atomic<uint64_t> step_ = 0;  // counts stepChanged()
  Statistics statistics_;
};

}  // namespace curvisplat
