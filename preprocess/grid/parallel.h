// TBB's loops, as conversion uses them: each call of a body holds a permit to compute (stream/base/compute_permits.h), where the
// thread that begins the loop holds one. So `--threads` bounds them together with the threads that read ahead.
#pragma once

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

}  // namespace curvisplat
