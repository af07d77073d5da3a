// Which pages of a long array are in memory: those that were wanted last. The caller has the pages themselves, in slots.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace curvisplat {

class PageSlots {
 public:
  static constexpr uint32_t kNone = UINT32_MAX;

  /// A page has 2^shift items. At most `slots` of them are in memory.
  PageSlots(uint64_t items, unsigned shift, uint64_t slots);

  uint64_t pages() const { return slots_.size(); }
  /// kNone if it is not in memory.
  uint32_t slotOf(uint64_t page) const { return slots_[page]; }
  void setMost(uint64_t slots) { most_ = slots; }

  /// The pages of these items are wanted, and no others. Returns whether they fit.
  bool want(std::span<const uint64_t> items);
  /// The same, if all items that have been held allow it: the items of pages that were in memory before, over the items that
  /// were wanted, are at most `most_again`. Where it returns false nothing is held.
  bool hold(std::span<const uint64_t> items, double most_again);
  /// want() of pages [first, end).
  bool wantPages(uint64_t first, uint64_t end);
  /// Those of them that are not in memory, rising.
  std::span<const uint64_t> missing() const { return missing_; }
  /// Pages that have to leave memory for them. Their slots are free now.
  struct Left {
    uint64_t page;
    uint32_t slot;
  };
  /// Gives slots to the missing ones. Only if all that is wanted fits.
  std::span<const Left> place();
  /// The page leaves memory.
  void leave(uint64_t page);

 private:
  void wantPage(uint64_t page);
  bool wantsFit();

  const unsigned shift_;
  uint64_t most_, now_ = 0, wanted_ = 0;
  std::vector<uint32_t> slots_, free_;
  std::vector<uint64_t> used_at_;              // [page]
  std::vector<bool> was_in_memory_;            // [page]
  uint64_t held_ = 0, again_ = 0;              // items, by hold()
  std::vector<uint64_t> in_memory_, missing_;  // pages
  std::vector<Left> left_;
  uint32_t slots_made_ = 0;
};

}  // namespace curvisplat
