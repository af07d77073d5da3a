// Bounds the threads of a conversion that compute at a time to `--threads`: TBB's, and those that read ahead of them.
#pragma once

#include <tbb/global_control.h>
#include <tbb/info.h>

#include "stream/base/compute_permits.h"

namespace curvisplat {

/// From its constructor to its destructor, in the thread that converts. Loops whose bodies are withPermit() keep to it, and
/// ReadAhead. Two kinds of threads do not: TBB's that sort points or faces of a mesh, while hardly anything is read, and the one that
/// writes temporary splats, which mostly waits for the disk.
class ConversionThreads {
 public:
  explicit ConversionThreads(unsigned threads)
      : of_loops_(tbb::global_control::max_allowed_parallelism, threads),
        permits_(threads),
        // Where all cores may be used, the system sees to it, and a core is another thread's while one waits for the disk.
        computing_(threads < static_cast<unsigned>(tbb::info::default_concurrency()) ? &permits_ : nullptr) {}

 private:
  const tbb::global_control of_loops_;
  ComputePermits permits_;
  const Computing computing_;
};

}  // namespace curvisplat
