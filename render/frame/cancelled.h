// The exception that ends a cancelled frame.
#pragma once

#include <stdexcept>

namespace curvisplat {

/// Thrown by FrameRenderer's drawing functions after a call of cancel().
class Cancelled : public std::runtime_error {
 public:
  Cancelled() : std::runtime_error("the frame was cancelled") {}
};

}  // namespace curvisplat
