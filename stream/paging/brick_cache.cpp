#include "stream/paging/brick_cache.h"

#include <algorithm>
#include <utility>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr uint64_t kArrays = 16;
// Arrays begin at whole cache lines.
constexpr uint64_t kLineFloats = Arena::kBlockAlignment / sizeof(float);

uint64_t strideOf(uint64_t splats) {
  return (splats + kLineFloats - 1) / kLineFloats * kLineFloats;
}

}  // namespace

BrickCache::BrickCache(uint64_t capacity_bytes) : arena_(capacity_bytes) {}

BrickCache::~BrickCache() {
  CURVISPLAT_CHECK_OP(entries_.size(), ==, unpinned_.size());
}

uint64_t BrickCache::charge(uint64_t splats) {
  return Arena::charge(kArrays * strideOf(splats) * sizeof(float));
}

void BrickCache::beginTurn(const std::vector<uint32_t>& bricks) {
  const std::lock_guard lock(mutex_);
  ++turn_;
  for (const uint32_t brick : bricks) {
    const auto found = entries_.find(brick);
    if (found == entries_.end()) continue;
    Entry& entry = found->second;
    entry.turn = turn_;
    if (entry.pins == 0) unpinned_.splice(unpinned_.end(), unpinned_, entry.unpinned);
  }
}

std::optional<BrickCache::Pin> BrickCache::find(uint32_t brick) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(brick);
  if (found == entries_.end() || !found->second.whole) {
    ++statistics_.misses;
    return {};
  }
  ++statistics_.hits;
  Entry& entry = found->second;
  if (entry.pins++ == 0) unpinned_.erase(entry.unpinned);
  entry.turn = turn_;
  return Pin(*this, entry);
}

std::optional<BrickCache::Room> BrickCache::makeRoom(uint32_t brick, uint32_t splats) {
  const uint64_t stride = strideOf(splats), bytes = charge(splats);
  const std::lock_guard lock(mutex_);
  if (bytes > arena_.capacity() || entries_.contains(brick)) return {};
  std::byte* block = arena_.allocate(bytes);
  while (!block) {
    if (unpinned_.empty() || unpinned_.front()->turn == turn_) return {};
    ++statistics_.evictions;
    remove(*unpinned_.front());
    block = arena_.allocate(bytes);
  }
  Entry& entry = entries_[brick];
  entry.brick = brick;
  entry.bytes = bytes;
  entry.turn = turn_;
  entry.block = block;
  entry.pins = 1;
  entry.step = step_;
  entry.geometry.border_code = reinterpret_cast<uint32_t*>(block);
  auto* array = reinterpret_cast<float*>(block) + stride;
  for (float** each :
       {&entry.geometry.x, &entry.geometry.y, &entry.geometry.z, &entry.geometry.axis0, &entry.geometry.axis1,
        &entry.geometry.axis2, &entry.geometry.shear10, &entry.geometry.shear20, &entry.geometry.shear21,
        &entry.geometry.weight, &entry.values.mean, &entry.values.slope0, &entry.values.slope1,
        &entry.values.slope2, &entry.values.variance}) {
    *each = array;
    array += stride;
  }
  entry.geometry.count = entry.values.count = splats;
  ++statistics_.bricks;
  statistics_.bytes += bytes;
  statistics_.peak_bytes = std::max(statistics_.peak_bytes, statistics_.bytes);
  return Room(*this, entry);
}

BrickCache::Statistics BrickCache::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

bool BrickCache::contains(uint32_t brick) const {
  const std::lock_guard lock(mutex_);
  return entries_.contains(brick);
}

void BrickCache::stepChanged() {
  const std::lock_guard lock(mutex_);
  CURVISPLAT_CHECK_OP(entries_.size(), ==, unpinned_.size());
  ++step_;
}

bool BrickCache::isStale(uint32_t brick) const {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(brick);
  if (found == entries_.end() || !found->second.whole) return false;
  const std::lock_guard refreshing(found->second.refreshing);
  return found->second.step != step_;
}

/// The mutex is held.
void BrickCache::unpin(Entry& entry) {
  if (--entry.pins == 0) entry.unpinned = unpinned_.insert(unpinned_.end(), &entry);
}

/// An entry without pins.
void BrickCache::remove(Entry& entry) {
  unpinned_.erase(entry.unpinned);
  arena_.free(entry.block, entry.bytes);
  --statistics_.bricks;
  statistics_.bytes -= entry.bytes;
  entries_.erase(entry.brick);
}

BrickCache::Pin::Pin(Pin&& other) noexcept
    : cache_(std::exchange(other.cache_, nullptr)), entry_(other.entry_) {}

BrickCache::Pin& BrickCache::Pin::operator=(Pin&& other) noexcept {
  std::swap(cache_, other.cache_);
  std::swap(entry_, other.entry_);
  return *this;
}

BrickCache::Pin::~Pin() {
  if (!cache_) return;
  const std::lock_guard lock(cache_->mutex_);
  cache_->unpin(*entry_);
}

GeometryArrays<const float> BrickCache::Pin::geometry() const {
  return entry_->geometry;
}

VariableArrays<const float> BrickCache::Pin::values() const {
  return entry_->values;
}

BrickCache::Room::Room(Room&& other) noexcept
    : cache_(std::exchange(other.cache_, nullptr)), entry_(other.entry_) {}

BrickCache::Room::~Room() {
  if (!cache_) return;
  const std::lock_guard lock(cache_->mutex_);
  cache_->unpin(*entry_);
  cache_->remove(*entry_);
}

const GeometryArrays<float>& BrickCache::Room::geometry() const {
  return entry_->geometry;
}

const VariableArrays<float>& BrickCache::Room::values() const {
  return entry_->values;
}

BrickCache::Pin BrickCache::Room::keep() && {
  BrickCache& cache = *std::exchange(cache_, nullptr);
  const std::lock_guard lock(cache.mutex_);
  entry_->whole = true;
  return Pin(cache, *entry_);
}

}  // namespace curvisplat
