// What readers subtract from doubles before they become floats: nothing, unless someone looks for digits that single precision loses
// (warningsOfRanges(), preprocess/survey).
#pragma once

namespace curvisplat {

/// While it exists, the readers that this thread calls subtract `offset` from the doubles that they convert to floats.
class FloatOffset {
 public:
  explicit FloatOffset(double offset) { current_ = offset; }
  ~FloatOffset() { current_ = 0; }
  FloatOffset(const FloatOffset&) = delete;
  FloatOffset& operator=(const FloatOffset&) = delete;

  static double current() { return current_; }

 private:
  static inline constinit thread_local double current_ = 0;
};

}  // namespace curvisplat
