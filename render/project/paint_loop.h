// A painter's loops: on the calling thread and on TBB's, as many at a time as there are permits to compute.
//
// Each thread that gets a permit takes a few neighbours at a time until none is left, and gives way to urgent threads in
// between. The loop ends when the last job has ended, and does not wait for threads that have no permit then.
#pragma once

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cstddef>

#include "stream/base/compute_permits.h"
#include "stream/base/trace.h"

namespace curvisplat {

class PaintLoop {
 public:
  /// `permits` outlives the loop; null: there is no bound but `threads`.
  PaintLoop(unsigned threads, ComputePermits* permits)
      : threads_(threads),
        permits_(permits),
        // TBB warns of more than there are cores.
        arena_(std::min(static_cast<int>(threads), tbb::info::default_concurrency())) {}

  unsigned threads() const { return threads_; }
  ComputePermits* permits() const { return permits_; }

  /// job(n), for all n below `count`, `neighbours` of them one after the other. `name`: of these in the trace. Rethrows what
  /// a job throws. One caller at a time.
  template <typename Job>
  void forAll(const char* name, size_t count, size_t neighbours, const Job& job) {
    std::atomic<size_t> next = 0;
    const auto isTaken = [&] { return next.load(std::memory_order_relaxed) >= count; };
    const auto takeSome = [&] {
      const size_t begin = next.fetch_add(neighbours, std::memory_order_relaxed);
      if (begin >= count) return;
      const TraceScope trace(name);
      for (size_t n = begin; n < std::min(begin + neighbours, count); ++n) job(n);
    };
    const auto work = [&](unsigned) {
      while (!isTaken()) {
        const Computing computing(permits_, Urgency::kNormal, isTaken);
        if (!computing.granted()) return;
        do takeSome();
        while (!isTaken() && !(permits_ && permits_->isWantedUrgently()));
        if (permits_ && isTaken()) permits_->recheck();
      }
    };
    const GivenBackPermit given_back;  // to the threads of the loop, of which this is one
    const size_t parts = (count + neighbours - 1) / neighbours;
    if (parts <= 1 || threads_ == 1) {
      work(0);
      return;
    }
    const unsigned threads = static_cast<unsigned>(std::min<size_t>(threads_, parts));
    arena_.execute([&] { tbb::parallel_for(0u, threads, work, tbb::simple_partitioner()); });
  }

 private:
  unsigned threads_;
  ComputePermits* permits_;
  tbb::task_arena arena_;
};

}  // namespace curvisplat
