// Measures the time that a scope takes and adds it to a sum of seconds. The scope is also in the trace, if one is
// written.
#pragma once

#include <chrono>

#include "stream/base/compute_permits.h"
#include "stream/base/trace.h"

namespace curvisplat {

class StageTimer {
 public:
  /// `name`, `kind`, `numbers`: in the trace, see TraceScope.
  StageTimer(double& seconds, const char* name, TraceKind kind = TraceKind::kWork, TraceNumbers numbers = {})
      : trace_(name, kind, numbers), seconds_(seconds), start_(std::chrono::steady_clock::now()) {}
  ~StageTimer() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  const TraceScope trace_;
  double& seconds_;
  const std::chrono::steady_clock::time_point start_;
};

/// The same for a scope in which this thread waits for another one, or for the disk: its permit to compute, if it has one, is
/// another's meanwhile.
class WaitTimer {
 public:
  WaitTimer(double& seconds, const char* name) : timer_(seconds, name, TraceKind::kWait) {}

 private:
  const StageTimer timer_;
  const GivenBackPermit given_back_;
};

}  // namespace curvisplat
