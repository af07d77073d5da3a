#include "stream/paging/arena.h"

#include <algorithm>
#include <new>

#include "stream/base/check.h"

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

}  // namespace curvisplat
