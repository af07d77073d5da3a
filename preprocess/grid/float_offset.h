// Readers subtract an offset from doubles before these become floats: 0, unless someone looks for digits that single precision
// loses (warningsOfRanges(), preprocess/survey).
#pragma once

namespace curvisplat {

/// Makes the readers that this thread calls subtract `offset` from doubles that become floats, until it is destroyed.
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
