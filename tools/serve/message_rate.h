// How many messages a page may send: a bucket that fills steadily and that each message takes from. A value type. While its
// camera moves, a page sends two messages in each frame of its screen, and screens have up to 240 frames a second.
#pragma once

#include <algorithm>

namespace curvisplat {

class MessageRate {
 public:
  static constexpr double kPerSecond = 600, kAtOnce = 1200;

  /// A message came in at `now_s`. Returns whether the page may go on.
  bool take(double now_s) {
    if (last_s_ >= 0) left_ = std::min(kAtOnce, left_ + (now_s - last_s_) * kPerSecond);
    last_s_ = now_s;
    left_ -= 1;
    return left_ >= 0;
  }

 private:
  double left_ = kAtOnce, last_s_ = -1;
};

}  // namespace curvisplat
