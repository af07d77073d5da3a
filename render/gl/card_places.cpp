#include "render/gl/card_places.h"

namespace curvisplat {

void CardPlaces::clear() {
  items_.clear();
  by_age_.clear();
  for (Page& page : pages_) page.items.clear();
  kept_page_ = 0;
}

void CardPlaces::removeLastPage() {
  for (const auto& [begin, item] : pages_.back().items) forget(item);
  pages_.pop_back();
}

const CardPlaces::Place* CardPlaces::find(const Item& item) const {
  const auto found = items_.find(item);
  return found == items_.end() || found->second.is_kept ? nullptr : &found->second.place;
}

void CardPlaces::need(const Item& item) {
  if (const auto found = items_.find(item); found != items_.end()) use(item, found->second);
}

uint64_t CardPlaces::endOf(const Item& item) const {
  const Place& place = items_.at(item).place;
  return place.begin + place.words;
}

void CardPlaces::enter(const Item& item, const Place& place, bool is_kept) {
  items_[item] = {place, frame_, is_kept};
  by_age_.emplace(frame_, item);
  pages_[place.page].items[place.begin] = item;
}

void CardPlaces::use(const Item& item, Entry& entry) {
  if (entry.used == frame_) return;
  by_age_.erase({entry.used, item});
  entry.used = frame_;
  by_age_.emplace(frame_, item);
}

/// Removes the item from all but its page.
void CardPlaces::forget(const Item& item) {
  const auto found = items_.find(item);
  by_age_.erase({found->second.used, item});
  items_.erase(found);
}

void CardPlaces::remove(const Item& item) {
  const Place place = items_.at(item).place;
  forget(item);
  pages_[place.page].items.erase(place.begin);
}

bool CardPlaces::keepFor(const Item& item, uint64_t words) {
  for (; kept_page_ < pages_.size(); ++kept_page_) {
    const Page& page = pages_[kept_page_];
    const uint64_t begin = page.items.empty() ? 0 : endOf(page.items.rbegin()->second);
    if (begin + words > page.words) continue;
    enter(item, {kept_page_, begin, words}, true);
    return true;
  }
  return false;
}

/// The place behind all items, or the first between them that is large enough.
std::optional<uint64_t> CardPlaces::freePlace(const Page& page, uint64_t words) const {
  uint64_t begin = page.items.empty() ? 0 : endOf(page.items.rbegin()->second);
  if (begin + words <= page.words) return begin;
  begin = 0;
  for (const auto& [at, item] : page.items) {
    if (at - begin >= words) return begin;
    begin = endOf(item);
  }
  return std::nullopt;
}

std::optional<CardPlaces::Place> CardPlaces::put(const Item& item, uint64_t words) {
  if (const auto found = items_.find(item); found != items_.end()) {
    if (found->second.place.words == words) {
      found->second.is_kept = false;
      use(item, found->second);
      return found->second.place;
    }
    remove(item);
  }
  for (size_t page = 0; page < pages_.size(); ++page)
    if (const auto begin = freePlace(pages_[page], words)) {
      const Place place{page, *begin, words};
      enter(item, place, false);
      return place;
    }
  return std::nullopt;
}

bool CardPlaces::removeOldest() {
  if (by_age_.empty() || by_age_.begin()->first == frame_) return false;
  const Item oldest = by_age_.begin()->second;
  remove(oldest);
  return true;
}

}  // namespace curvisplat
