#include "render/gl/card_places.h"

#include <algorithm>

namespace curvisplat {

void CardPlaces::clear() {
  items_.clear();
  for (Page& page : pages_) page.items.clear();
  kept_page_ = 0;
}

void CardPlaces::removePages() {
  clear();
  pages_.clear();
}

const CardPlaces::Place* CardPlaces::find(const Item& item) const {
  const auto found = items_.find(item);
  return found == items_.end() || found->second.is_kept ? nullptr : &found->second.place;
}

void CardPlaces::need(const Item& item) {
  if (const auto found = items_.find(item); found != items_.end()) found->second.used = frame_;
}

uint64_t CardPlaces::endOf(const Item& item) const {
  const Place& place = items_.at(item).place;
  return place.begin + place.words;
}

void CardPlaces::enter(const Item& item, const Entry& entry) {
  items_[item] = entry;
  pages_[entry.place.page].items[entry.place.begin] = item;
}

bool CardPlaces::keepFor(const Item& item, uint64_t words) {
  for (; kept_page_ < pages_.size(); ++kept_page_) {
    const Page& page = pages_[kept_page_];
    const uint64_t begin = page.items.empty() ? 0 : endOf(page.items.rbegin()->second);
    if (begin + words > page.words) continue;
    enter(item, {{kept_page_, begin, words}, frame_, true});
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
  if (const auto found = items_.find(item); found != items_.end() && found->second.place.words == words) {
    found->second.is_kept = false;
    found->second.used = frame_;
    return found->second.place;
  }
  for (size_t page = 0; page < pages_.size(); ++page)
    if (const auto begin = freePlace(pages_[page], words)) {
      const Place place{page, *begin, words};
      enter(item, {place, frame_, false});
      return place;
    }
  return std::nullopt;
}

bool CardPlaces::removeOldest() {
  const auto oldest = std::min_element(items_.begin(), items_.end(), [](const auto& a, const auto& b) {
    return a.second.used < b.second.used;
  });
  if (oldest == items_.end() || oldest->second.used == frame_) return false;
  const Place& place = oldest->second.place;
  pages_[place.page].items.erase(place.begin);
  items_.erase(oldest);
  return true;
}

}  // namespace curvisplat
