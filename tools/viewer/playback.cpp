#include "tools/viewer/playback.h"

#include <algorithm>

namespace curvisplat {

bool Playback::goTo(uint64_t step) {
  step = std::min(step, steps_ - 1);
  if (step == step_) return false;
  step_ = step;
  shown_since_s_.reset();
  return true;
}

bool Playback::advance(bool forwards) {
  if (forwards) return goTo(step_ + 1 < steps_ ? step_ + 1 : loops_ ? 0 : step_);
  return goTo(step_ > 0 ? step_ - 1 : loops_ ? steps_ - 1 : 0);
}

void Playback::toggle() {
  playing_ = !playing_ && steps_ > 1;
  shown_since_s_.reset();
  if (playing_ && !loops_ && step_ + 1 == steps_) step_ = 0;
}

std::optional<uint64_t> Playback::next() const {
  if (!playing_) return std::nullopt;
  if (step_ + 1 < steps_) return step_ + 1;
  return loops_ ? std::optional<uint64_t>(0) : std::nullopt;
}

bool Playback::tick(double now_s) {
  if (!playing_) return false;
  if (!shown_since_s_) shown_since_s_ = now_s;
  if (wait(now_s) > 0) return false;
  const std::optional<uint64_t> following = next();
  if (!following) {
    playing_ = false;
    return true;  // the last step is drawn at rest now
  }
  return goTo(*following);
}

double Playback::wait(double now_s) const {
  return shown_since_s_ ? *shown_since_s_ + 1 / steps_per_s_ - now_s : 0;
}

}  // namespace curvisplat
