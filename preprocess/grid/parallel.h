// TBB's loops, as conversion uses them, and the bound that `--threads` sets to them. Each call of a loop's
// body holds a permit to compute (stream/base/compute_permits.h) where the thread that begins the loop
// holds one, so ConversionThreads bounds loops together with the threads that read ahead.
#pragma once

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_reduce.h>
#include <tbb/task_group.h>

#include "stream/base/compute_permits.h"

namespace curvisplat {

/// body(n) for all n from `first` to `last` - 1.
template <typename Index, typename Body>
void parallelFor(Index first, Index last, const Body& body) {
  tbb::parallel_for(first, last, withPermit(body));
}
template <typename Index, typename Body>
void parallelFor(Index first, Index last, const Body& body, tbb::task_group_context& context) {
  tbb::parallel_for(first, last, withPermit(body), context);
}

/// body(part) for all parts of a range.
template <typename Range, typename Body>
void parallelFor(const Range& range, const Body& body) {
  tbb::parallel_for(range, withPermit(body));
}

/// `join`ed results of body(part, result).
template <typename Range, typename Result, typename Body, typename Join>
Result parallelReduce(const Range& range, const Result& identity, const Body& body, const Join& join) {
  return tbb::parallel_reduce(range, identity, withPermit(body), join);
}

template <typename... Works>
void parallelInvoke(const Works&... works) {
  tbb::parallel_invoke(withPermit(works)...);
}

/// Bounds the threads that compute at the same time to `--threads`, from its constructor to its destructor,
/// in the thread that converts. The loops above and ReadAhead keep to the bound. Two kinds of threads do
/// not: TBB's that sort points or faces of a mesh, while hardly anything is read, and the one that writes
/// temporary splats, which mostly waits for the disk.
class ConversionThreads {
 public:
  explicit ConversionThreads(unsigned threads)
      : of_loops_(tbb::global_control::max_allowed_parallelism, threads),
        permits_(threads),
        // Where all cores may be used, the system sees to it, and a core is another thread's while one waits
        // for the disk.
        computing_(threads < static_cast<unsigned>(tbb::info::default_concurrency()) ? &permits_ : nullptr) {}

 private:
  const tbb::global_control of_loops_;
  ComputePermits permits_;
  const Computing computing_;
};

}  // namespace curvisplat
