#include "tools/view/playback.h"

#include <algorithm>
#include <cmath>

namespace curvisplat {

bool Playback::goTo(const StepPosition& position) {
  const uint64_t step = std::min(position.step, steps_ - 1);
  const double part = dividesAfter(step) ? position.part : 0;
  if (step == step_ && part == part_) return false;
  step_ = step;
  part_ = part;
  shown_since_s_.reset();
  return true;
}

bool Playback::setInterpolates(bool interpolates) {
  interpolates_ = interpolates;
  return goTo(position());
}

bool Playback::advance(bool forwards) {
  if (forwards) return goTo(step_ + 1 < steps_ ? step_ + 1 : loops_ ? 0 : step_);
  if (part_ > 0) return goTo(step_);
  return goTo(step_ > 0 ? step_ - 1 : loops_ ? steps_ - 1 : 0);
}

void Playback::toggle() {
  playing_ = !playing_ && steps_ > 1;
  shown_since_s_.reset();
  if (playing_ && !next()) goTo(backwards_ ? steps_ - 1 : 0);
}

std::optional<StepPosition> Playback::next() const {
  if (!playing_) return std::nullopt;
  return backwards_ ? nextBackwards() : nextForwards();
}

std::optional<StepPosition> Playback::nextForwards() const {
  const double part = std::floor(part_ * kParts + 1) / kParts;
  if (dividesAfter(step_) && part < 1) return StepPosition{step_, part};
  if (step_ + 1 < steps_) return StepPosition{step_ + 1};
  return loops_ ? std::optional(StepPosition{}) : std::nullopt;
}

std::optional<StepPosition> Playback::nextBackwards() const {
  if (part_ > 0) return StepPosition{step_, std::ceil(part_ * kParts - 1) / kParts};
  if (step_ == 0) return loops_ ? std::optional(StepPosition{steps_ - 1}) : std::nullopt;
  return StepPosition{step_ - 1, dividesAfter(step_ - 1) ? 1 - 1.0 / kParts : 0};
}

bool Playback::tick(double now_s) {
  if (!playing_) return false;
  if (!shown_since_s_) shown_since_s_ = now_s;
  if (wait(now_s) > 0) return false;
  const std::optional<StepPosition> following = next();
  if (!following) {
    playing_ = false;
    return true;  // the last step is drawn at rest now
  }
  return goTo(*following);
}

double Playback::wait(double now_s) const {
  const uint64_t from = backwards_ && part_ == 0 && step_ > 0 ? step_ - 1 : step_;
  const double for_s = 1 / steps_per_s_ / (dividesAfter(from) ? kParts : 1);
  return shown_since_s_ ? *shown_since_s_ + for_s - now_s : 0;
}

}  // namespace curvisplat
