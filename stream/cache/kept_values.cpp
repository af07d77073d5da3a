#include "stream/cache/kept_values.h"

#include <algorithm>
#include <utility>

namespace curvisplat {
namespace {

constexpr uint64_t kArrays = 5;           // of a SplatVariable
constexpr uint64_t kOverheadBytes = 512;  // of an entry: its nodes, and what the allocator adds to six blocks

}  // namespace

uint64_t KeptValues::charge(uint64_t splats) {
  return kArrays * sizeof(float) * splats + kOverheadBytes;
}

KeptValues::Values KeptValues::find(const Key& key) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(key);
  if (found == entries_.end()) {
    ++statistics_.misses;
    return nullptr;
  }
  ++statistics_.hits;
  used_.splice(used_.end(), used_, found->second.used);
  return found->second.values;
}

void KeptValues::keep(const Key& key, Values values) {
  const uint64_t bytes = charge(values->size());
  if (bytes > capacity_) return;
  const MutexLock lock(mutex_);
  if (entries_.contains(key)) return;
  while (statistics_.bytes + bytes > capacity_) {
    const auto oldest = entries_.find(used_.front());
    statistics_.bytes -= charge(oldest->second.values->size());
    entries_.erase(oldest);
    used_.pop_front();
  }
  entries_[key] = {std::move(values), used_.insert(used_.end(), key)};
  statistics_.bytes += bytes;
  statistics_.peak_bytes = std::max(statistics_.peak_bytes, statistics_.bytes);
}

KeptValues::Statistics KeptValues::statistics() const {
  const MutexLock lock(mutex_);
  return statistics_;
}

}  // namespace curvisplat
