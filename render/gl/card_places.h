// This says where in the pages of a card's memory the bricks' geometry lies, and their values at each time step.
//
// An item has one range of words of one page. What was not needed lately goes first where there is no place. No more
// than the logic: card_bricks.h has the pages. One thread.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace curvisplat {

class CardPlaces {
 public:
  /// The geometry of a brick, or its values at a step, or between two (StepPosition).
  struct Item {
    uint32_t brick = 0;
    bool has_values = false;
    uint64_t step = 0;
    double part = 0;
    auto operator<=>(const Item&) const = default;
  };
  struct Place {
    size_t page = 0;
    uint64_t begin = 0, words = 0;
  };

  /// Removes all items.
  void clear();
  /// Removes the last page, and what has its place there.
  void removeLastPage();
  void addPage(uint64_t words) { pages_.push_back({words, {}}); }
  size_t pages() const { return pages_.size(); }

  /// Begins a frame, in which nothing is needed yet.
  void beginFrame() { ++frame_; }
  /// Null if the item has no place, or only one that is kept for it.
  const Place* find(const Item& item) const;
  /// The item stays until the next frame begins.
  void need(const Item& item);

  /// Keeps a place for each of the items, one after the other, until put() fills it. Items have no places yet. False where
  /// the pages end first.
  bool keepFor(const Item& item, uint64_t words);
  /// A place for an item that has none: the one that is kept for it, or a free one. The item is needed.
  std::optional<Place> put(const Item& item, uint64_t words);
  /// Removes the item that has not been needed for the longest time. False if all are needed now.
  bool removeOldest();

 private:
  struct Entry {
    Place place;
    uint64_t used = 0;  // number of the frame that last needed it
    bool is_kept = false;
  };
  struct Page {
    uint64_t words;
    std::map<uint64_t, Item> items;  // [Place::begin]
  };
  std::optional<uint64_t> freePlace(const Page& page, uint64_t words) const;
  uint64_t endOf(const Item& item) const;
  void enter(const Item& item, const Place& place, bool is_kept);
  void use(const Item& item, Entry& entry);
  void forget(const Item& item);
  void remove(const Item& item);

  std::vector<Page> pages_;
  std::map<Item, Entry> items_;
  std::set<std::pair<uint64_t, Item>> by_age_;  // Entry::used and its item
  size_t kept_page_ = 0;                        // that keepFor() fills
  uint64_t frame_ = 0;
};

}  // namespace curvisplat
