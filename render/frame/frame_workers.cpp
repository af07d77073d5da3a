#include "render/frame/frame_workers.h"

#include <algorithm>

#include "render/project/depth_sort.h"
#include "stream/base/error.h"
#include "stream/base/stage_timer.h"

namespace curvisplat {

/// What a worker keeps from brick to brick, so that preparing one allocates nothing.
struct FrameWorkers::Worker {
  BrickSource::Scratch scratch;
  BrickProjector projector;
  DepthSorter sorter;
  FrameStatistics statistics;
};

FrameWorkers::FrameWorkers(BrickSource& source, SegmentRing& ring, unsigned count)
    : source_(source), ring_(ring), team_(count, "prepare") {
  for (unsigned n = 0; n < count; ++n) workers_.push_back(std::make_unique<Worker>());
}

FrameWorkers::~FrameWorkers() {
  ring_.close();
  source_.stop();
}

void FrameWorkers::start(const FrameWork& work) {
  work_ = &work;
  next_ = 0;
  first_failure_ = nullptr;
  for (auto& worker : workers_) {
    worker->statistics = {};
    worker->scratch.times = {};
    worker->scratch.waited_s = 0;
  }
  team_.start([this](unsigned number) { loop(*workers_[number]); });
}

void FrameWorkers::finish(FrameStatistics& sum) {
  team_.wait();
  for (const auto& worker : workers_) {
    const FrameStatistics& part = worker->statistics;
    sum.verify_s += worker->scratch.times.verify_s;
    sum.decode_s += worker->scratch.times.decode_s;
    sum.read_waited_s += worker->scratch.waited_s;
    sum.project_s += part.project_s;
    sum.sort_s += part.sort_s;
    sum.workers_waited_s += part.workers_waited_s;
    sum.splats_read += part.splats_read;
    sum.splats_clipped += part.splats_clipped;
    sum.splats_off_screen += part.splats_off_screen;
    sum.splats_transparent += part.splats_transparent;
    sum.splats_drawn += part.splats_drawn;
    sum.bricks_hidden += part.bricks_hidden;
    for (const BrickFailure& failure : part.bricks_unreadable) sum.bricks_unreadable.push_back(failure);
  }
  std::sort(sum.bricks_unreadable.begin(), sum.bricks_unreadable.end(),
            [](const BrickFailure& a, const BrickFailure& b) { return a.brick < b.brick; });
  // One that is drawn in several parts failed for each.
  const auto again =
      std::unique(sum.bricks_unreadable.begin(), sum.bricks_unreadable.end(),
                  [](const BrickFailure& a, const BrickFailure& b) { return a.brick == b.brick; });
  sum.bricks_unreadable.erase(again, sum.bricks_unreadable.end());
  if (first_failure_) std::rethrow_exception(first_failure_);
}

void FrameWorkers::startPrefetch() {
  team_.start([this](unsigned number) {
    try {
      while (source_.prefetchNext(workers_[number]->scratch)) {
      }
    } catch (...) {
      // A damaged brick is the frame's to report; the others can wait for it too.
      source_.stop();
    }
  });
}

void FrameWorkers::finishPrefetch() {
  team_.wait();
}

void FrameWorkers::loop(Worker& worker) {
  try {
    while (true) {
      const uint64_t sequence = next_++;
      if (sequence >= work_->parts.size() || !prepare(worker, sequence)) return;
    }
  } catch (...) {
    {
      const std::lock_guard lock(failing_);
      if (!first_failure_) first_failure_ = std::current_exception();
    }
    ring_.close();
    source_.stop();
  }
}

std::optional<BrickSource::Splats> FrameWorkers::fetch(Worker& worker, uint64_t sequence) {
  try {
    return source_.take(sequence, worker.scratch);
  } catch (const DamagedBrick& error) {
    if (!work_->keep_going) throw;
    const BrickPart& part = work_->parts[sequence];
    worker.statistics.bricks_unreadable.push_back({part.brick, error.what()});
    return source_.standIn(part, worker.scratch);
  }
}

/// A part that is hidden. False if the ring was stopped.
bool FrameWorkers::passOver(Worker& worker, uint64_t sequence) {
  {
    const StageTimer timer(worker.statistics.workers_waited_s);
    if (!ring_.acquire(sequence, 0)) return false;
  }
  ring_.commit(sequence);
  ++worker.statistics.bricks_hidden;
  return true;
}

bool FrameWorkers::prepare(Worker& worker, uint64_t sequence) {
  FrameStatistics& statistics = worker.statistics;
  const uint32_t brick = work_->parts[sequence].brick;
  // What stands in for a damaged brick may reach out of its box: then nothing is passed over, so that the
  // same bricks are found damaged, and the same is drawn, whatever the order in which they come.
  const auto isHidden = [&] { return !work_->keep_going && work_->hidden.hides(brick); };
  if (isHidden()) {
    source_.pass(sequence);
    return passOver(worker, sequence);
  }
  {
    const std::optional<BrickSource::Splats> fetched = fetch(worker, sequence);
    if (!fetched) return false;
    if (isHidden()) return passOver(worker, sequence);
    const StageTimer timer(statistics.project_s);
    worker.projector.project(work_->settings, work_->table,
                             work_->cache.manifest().root.cellMin(fetched->cell), fetched->geometry,
                             fetched->values, fetched->ranges);
  }
  const std::vector<ScreenSplat>& splats = worker.projector.splats();
  std::span<const uint32_t> order;
  {
    const StageTimer timer(statistics.sort_s);
    order = worker.sorter.sort(worker.projector.depths(), work_->order);
  }
  std::optional<std::span<ScreenSplat>> segment;
  {
    const StageTimer timer(statistics.workers_waited_s);
    segment = ring_.acquire(sequence, splats.size());
  }
  if (!segment) return false;
  {
    const StageTimer timer(statistics.sort_s);
    for (size_t n = 0; n < order.size(); ++n) (*segment)[n] = splats[order[n]];
  }
  ring_.commit(sequence);

  const ProjectionCounts& counts = worker.projector.counts();
  statistics.splats_read += counts.read;
  statistics.splats_clipped += counts.clipped;
  statistics.splats_off_screen += counts.off_screen;
  statistics.splats_transparent += counts.transparent;
  statistics.splats_drawn += counts.drawn;
  return true;
}

}  // namespace curvisplat
