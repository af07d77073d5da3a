// Measures the time that a scope takes and adds it to a sum of seconds. The scope is also in the trace, if one is
// written.
#pragma once

#include <chrono>

#include "stream/base/trace.h"

namespace curvisplat {

class StageTimer {
 public:
  /// `name`, `kind`: in the trace, see TraceScope.
  StageTimer(double& seconds, const char* name, TraceKind kind = TraceKind::kWork)
      : trace_(name, kind), seconds_(seconds), start_(std::chrono::steady_clock::now()) {}
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

}  // namespace curvisplat
