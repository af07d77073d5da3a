// The exception that ends work which was asked to stop.
#pragma once

#include <stop_token>
#include <string>

#include "stream/base/error.h"

namespace curvisplat {

/// Thrown by work that was asked to stop, by Progress::stop() or a std::stop_token. Not a failure.
class Interrupted : public Error {
 public:
  Interrupted(int signal, const std::string& text) : Error(text), signal_(signal) {}
  /// The signal that Progress::stop() was given; 0: none.
  int signal() const { return signal_; }

 private:
  int signal_;
};

/// Throws Interrupted once a stop of `token` was requested. Any thread; costs a load.
inline void throwIfStopped(const std::stop_token& token) {
  if (token.stop_requested()) throw Interrupted(0, "interrupted");
}

}  // namespace curvisplat
