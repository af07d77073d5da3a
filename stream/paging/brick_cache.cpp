#include "stream/paging/brick_cache.h"

#include <algorithm>
#include <new>
#include <type_traits>
#include <utility>

#include "stream/base/error.h"

namespace curvisplat {

Arena::Arena(uint64_t capacity) : capacity_(capacity / kBlockAlignment * kBlockAlignment) {
  if (capacity_ == 0) return;
  memory_.reset(static_cast<std::byte*>(std::aligned_alloc(kBlockAlignment, capacity_)));
  if (!memory_) throw std::bad_alloc();
  holes_.emplace(0, capacity_);
}

std::byte* Arena::allocate(uint64_t bytes) {
  const uint64_t wanted = charge(std::max<uint64_t>(bytes, 1));
  const auto hole =
      std::find_if(holes_.begin(), holes_.end(), [&](const auto& each) { return each.second >= wanted; });
  if (hole == holes_.end()) return nullptr;
  const auto [offset, size] = *hole;
  holes_.erase(hole);
  if (size > wanted) holes_.emplace(offset + wanted, size - wanted);
  return memory_.get() + offset;
}

void Arena::free(std::byte* block, uint64_t bytes) {
  auto offset = static_cast<uint64_t>(block - memory_.get());
  uint64_t size = charge(std::max<uint64_t>(bytes, 1));
  CURVISPLAT_CHECK_OP(offset + size, <=, capacity_);
  auto after = holes_.lower_bound(offset);
  if (after != holes_.end()) {
    CURVISPLAT_CHECK_OP(offset + size, <=, after->first);
    if (offset + size == after->first) {
      size += after->second;
      after = holes_.erase(after);
    }
  }
  if (after != holes_.begin()) {
    const auto before = std::prev(after);
    CURVISPLAT_CHECK_OP(before->first + before->second, <=, offset);
    if (before->first + before->second == offset) {
      offset = before->first;
      size += before->second;
      holes_.erase(before);
    }
  }
  holes_.emplace(offset, size);
}

namespace {

// Arrays begin at whole cache lines.
constexpr uint64_t kLineFloats = Arena::kBlockAlignment / sizeof(float);

/// Arrays of a variable.
uint64_t arraysOfVariable() {
  uint64_t count = 0;
  VariableArrays<float> arrays{};
  forEachArrayOfVariable(arrays, [&](auto&) { ++count; });
  return count;
}

uint64_t strideOf(uint64_t splats) {
  return (splats + kLineFloats - 1) / kLineFloats * kLineFloats;
}

}  // namespace

BrickCache::BrickCache(uint64_t capacity_bytes, bool two_variables)
    : capacity_(capacity_bytes), two_variables_(two_variables), arena_(capacity_bytes) {}

BrickCache::~BrickCache() {
  CURVISPLAT_CHECK_OP(entries_.size(), ==, unpinned_.size());
}

uint64_t BrickCache::charge(uint64_t splats, bool two_variables) {
  const uint64_t arrays = kArraysOfSplats + (two_variables ? arraysOfVariable() : 0);
  return Arena::charge(arrays * strideOf(splats) * sizeof(float));
}

void BrickCache::beginEpoch(const std::vector<BrickKey>& bricks) {
  const MutexLock lock(mutex_);
  ++epoch_;
  for (const BrickKey& brick : bricks) {
    const auto found = entries_.find(brick);
    if (found == entries_.end()) continue;
    Entry& entry = found->second;
    entry.epoch = epoch_;
    if (entry.pins == 0) unpinned_.splice(unpinned_.end(), unpinned_, entry.unpinned);
  }
}

std::optional<BrickCache::Pin> BrickCache::find(BrickKey brick) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(brick);
  if (found == entries_.end() || !found->second.whole) {
    ++statistics_.misses;
    return {};
  }
  ++statistics_.hits;
  Entry& entry = found->second;
  if (entry.pins++ == 0) unpinned_.erase(entry.unpinned);
  entry.epoch = epoch_;
  return Pin(*this, entry);
}

std::optional<BrickCache::Slot> BrickCache::makeSlot(BrickKey brick, uint32_t splats) {
  const uint64_t stride = strideOf(splats), bytes = charge(splats, two_variables_);
  const MutexLock lock(mutex_);
  if (bytes > capacity_ || entries_.contains(brick)) return {};
  std::byte* block = arena_.allocate(bytes);
  while (!block) {
    if (unpinned_.empty() || unpinned_.front()->epoch == epoch_) return {};
    ++statistics_.evictions;
    remove(*unpinned_.front());
    block = arena_.allocate(bytes);
  }
  Entry& entry = entries_[brick];
  entry.key = brick;
  entry.bytes = bytes;
  entry.epoch = epoch_;
  entry.block = block;
  entry.pins = 1;
  entry.step = step_;
  std::byte* array = block;
  const auto place = [&](auto*& at) {
    at = reinterpret_cast<std::remove_reference_t<decltype(at)>>(array);
    array += stride * sizeof(float);
  };
  forEachArrayOfGeometry(entry.geometry, place);
  forEachArrayOfVariable(entry.values, place);
  if (two_variables_) {
    forEachArrayOfVariable(entry.second, place);
    entry.second.count = splats;
  }
  entry.geometry.count = entry.values.count = splats;
  ++statistics_.bricks;
  statistics_.bytes += bytes;
  statistics_.peak_bytes = std::max(statistics_.peak_bytes, statistics_.bytes);
  return Slot(*this, entry);
}

BrickCache::Statistics BrickCache::statistics() const {
  const MutexLock lock(mutex_);
  return statistics_;
}

bool BrickCache::contains(BrickKey brick) const {
  const MutexLock lock(mutex_);
  return entries_.contains(brick);
}

void BrickCache::stepChanged() {
  const MutexLock lock(mutex_);
  CURVISPLAT_CHECK_OP(entries_.size(), ==, unpinned_.size());
  ++step_;
  for (auto next = unpinned_.begin(); next != unpinned_.end();) {
    Entry& entry = **next++;
    if (entry.key.merging != 0) remove(entry);
  }
}

bool BrickCache::isStale(BrickKey brick) const {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(brick);
  return found != entries_.end() && found->second.whole && found->second.step != step_;
}

void BrickCache::unpin(Entry& entry) {
  if (--entry.pins == 0) entry.unpinned = unpinned_.insert(unpinned_.end(), &entry);
}

/// An entry without pins.
void BrickCache::remove(Entry& entry) {
  unpinned_.erase(entry.unpinned);
  arena_.free(entry.block, entry.bytes);
  --statistics_.bricks;
  statistics_.bytes -= entry.bytes;
  entries_.erase(BrickKey(entry.key));  // a copy: the entry goes
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
  const MutexLock lock(cache_->mutex_);
  cache_->unpin(*entry_);
}

GeometryArrays<const float> BrickCache::Pin::geometry() const {
  return entry_->geometry;
}

VariableArrays<const float> BrickCache::Pin::values() const {
  return entry_->values;
}

VariableArrays<const float> BrickCache::Pin::second() const {
  return entry_->second;
}

BrickCache::Slot::Slot(Slot&& other) noexcept
    : cache_(std::exchange(other.cache_, nullptr)), entry_(other.entry_) {}

BrickCache::Slot::~Slot() {
  if (!cache_) return;
  const MutexLock lock(cache_->mutex_);
  cache_->unpin(*entry_);
  cache_->remove(*entry_);
}

const GeometryArrays<float>& BrickCache::Slot::geometry() const {
  return entry_->geometry;
}

const VariableArrays<float>& BrickCache::Slot::values() const {
  return entry_->values;
}

const VariableArrays<float>& BrickCache::Slot::second() const {
  return entry_->second;
}

BrickCache::Pin BrickCache::Slot::keep() && {
  BrickCache& cache = *std::exchange(cache_, nullptr);
  const MutexLock lock(cache.mutex_);
  entry_->whole = true;
  return Pin(cache, *entry_);
}

}  // namespace curvisplat
