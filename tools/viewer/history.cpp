#include "tools/viewer/history.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxStates = 200;

}  // namespace

void History::record(const ViewState& state) {
  // Whether two are the same: what is saved of them says so, and costs less than a millisecond.
  if (toJson(state) == toJson(states_[at_])) return;
  states_.resize(at_ + 1, state);
  states_.push_back(state);
  if (states_.size() > kMaxStates) states_.erase(states_.begin());
  at_ = states_.size() - 1;
}

}  // namespace curvisplat
