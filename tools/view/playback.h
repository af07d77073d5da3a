// Playback of the time steps in the window: which step is shown, and which comes next. A value type; knows
// no window.
//
// While it plays, a step follows the one before as soon as its picture has been shown for 1/speed seconds:
// steps are not left out, a slow machine plays slowly. If it interpolates, it also stops kParts - 1 times
// between two steps of one geometry, for as short as lets the speed be the same. It plays in either
// direction.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "stream/cache/series.h"

namespace curvisplat {

class Playback {
 public:
  static constexpr int kParts = 4;

  /// `steps`: how many the cache has. `joined`: [step], whether it has the geometry of the next one.
  explicit Playback(uint64_t steps, std::vector<bool> joined = {})
      : steps_(steps), joined_(std::move(joined)) {
    joined_.resize(steps_);
  }

  uint64_t steps() const { return steps_; }
  uint64_t step() const { return step_; }
  StepPosition position() const { return {step_, part_}; }
  bool interpolates() const { return interpolates_; }
  bool isPlaying() const { return playing_; }
  bool loops() const { return loops_; }
  bool isBackwards() const { return backwards_; }
  double stepsPerSecond() const { return steps_per_s_; }

  /// Goes to a step, or to the last one if it lies behind it. Returns whether that changes the step.
  bool goTo(uint64_t step) { return goTo(StepPosition{step}); }
  /// The same, between two steps if it interpolates and they have one geometry.
  bool goTo(const StepPosition& position);
  /// Goes to the next or the previous step; at an end to the other end if it loops. Returns whether that
  /// changes it.
  bool advance(bool forwards);
  void stop() { playing_ = false; }
  /// Starts or stops. If it does not loop, it starts from the other end where it could not go on.
  void toggle();
  void setLoop(bool loops) { loops_ = loops; }
  void setBackwards(bool backwards) { backwards_ = backwards; }
  /// Returns whether that changes the position.
  bool setInterpolates(bool interpolates);
  void setStepsPerSecond(double steps_per_s) { steps_per_s_ = steps_per_s; }

  /// The position that comes next while it plays; nullopt at the end, or when it does not play.
  std::optional<StepPosition> next() const;
  /// The picture of the current position has been shown at `now_s`: goes on if it is time. Returns whether
  /// it did.
  bool tick(double now_s);
  /// Seconds from `now_s` to when tick() may go on.
  double wait(double now_s) const;

 private:
  /// Whether there are positions between `step` and the next one.
  bool dividesAfter(uint64_t step) const { return interpolates_ && joined_[step] && step + 1 < steps_; }
  std::optional<StepPosition> nextForwards() const;
  std::optional<StepPosition> nextBackwards() const;

  uint64_t steps_, step_ = 0;
  double part_ = 0;  // of the way to the next step
  std::vector<bool> joined_;
  bool playing_ = false, loops_ = true, interpolates_ = false, backwards_ = false;
  double steps_per_s_ = 10;
  std::optional<double> shown_since_s_;
};

}  // namespace curvisplat
