// The end of a frame that was given up.
#pragma once

#include <stdexcept>

namespace curvisplat {

/// What render() throws when cancel() was called.
class Cancelled : public std::runtime_error {
 public:
  Cancelled() : std::runtime_error("the frame was cancelled") {}
};

}  // namespace curvisplat
