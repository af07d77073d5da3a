// Playback of the time steps in the window: which step is shown, and which comes next. A value type; knows no window.
//
// While it plays, a step follows the one before as soon as its picture has been shown for 1/speed seconds: steps are
// not left out, a slow machine plays slowly.
#pragma once

#include <cstdint>
#include <optional>

namespace curvisplat {

class Playback {
 public:
  /// `steps`: how many the cache has.
  explicit Playback(uint64_t steps) : steps_(steps) {}

  uint64_t steps() const { return steps_; }
  uint64_t step() const { return step_; }
  bool isPlaying() const { return playing_; }
  bool loops() const { return loops_; }
  double stepsPerSecond() const { return steps_per_s_; }

  /// Goes to a step, or to the last one if it lies behind it. Returns whether that changes the step.
  bool goTo(uint64_t step);
  /// Goes one step on or back; at an end to the other end if it loops. Returns whether that changes it.
  bool advance(bool forwards);
  /// Starts or stops. At the last step it starts from the first.
  void toggle();
  void setLoop(bool loops) { loops_ = loops; }
  void setStepsPerSecond(double steps_per_s) { steps_per_s_ = steps_per_s; }

  /// The step that comes after this one while it plays; nullopt at the end, or when it does not play.
  std::optional<uint64_t> next() const;
  /// The picture of the current step has been shown at `now_s`: goes on if it is time. Returns whether it did.
  bool tick(double now_s);
  /// Seconds from `now_s` to when tick() may go on.
  double wait(double now_s) const;

 private:
  uint64_t steps_, step_ = 0;
  bool playing_ = false, loops_ = true;
  double steps_per_s_ = 10;
  std::optional<double> shown_since_s_;
};

}  // namespace curvisplat
