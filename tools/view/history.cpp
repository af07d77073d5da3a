#include "tools/view/history.h"

#include <algorithm>
#include <utility>

namespace curvisplat {
namespace {

constexpr size_t kMaxStates = 200;

}  // namespace

History::History(const ViewState& first, const FilmEdit& film)
    : entries_{{first, std::make_shared<const FilmEdit>(film)}} {}

void History::record(const ViewState& state, const FilmEdit& film) {
  const Entry& newest = entries_[at_];
  const bool has_same_film = film.film() == newest.film->film();  // each change makes another one
  // Whether two are the same: what is saved of them says so, and costs less than a millisecond.
  if (has_same_film && toJson(state) == toJson(newest.state)) return;
  Entry entry{state, has_same_film ? newest.film : std::make_shared<const FilmEdit>(film)};
  entries_.resize(at_ + 1, entry);
  entries_.push_back(std::move(entry));
  if (entries_.size() > kMaxStates) entries_.erase(entries_.begin());
  at_ = entries_.size() - 1;
}

void History::raiseMemory(uint64_t bytes) {
  for (Entry& entry : entries_) entry.state.memory_bytes = std::max(entry.state.memory_bytes, bytes);
}

}  // namespace curvisplat
