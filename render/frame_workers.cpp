#include "render/frame_workers.h"

#include "render/depth_sort.h"
#include "render/thread_name.h"
#include "stream/stage_timer.h"

namespace curvisplat {

/// What a worker keeps from brick to brick, so that preparing one allocates nothing.
class WorkerScratch {
 public:
  SplatGeometry geometry;
  SplatVariable values;
  BrickProjector projector;
  DepthSorter sorter;
};

FrameWorkers::FrameWorkers(const FrameWork& work, SegmentRing& ring, unsigned count)
    : work_(work), ring_(ring), statistics_(count) {
  try {
    for (FrameStatistics& statistics : statistics_)
      threads_.emplace_back([this, &statistics] { loop(statistics); });
  } catch (...) {
    join();
    throw;
  }
}

FrameWorkers::~FrameWorkers() {
  join();
}

void FrameWorkers::join() {
  ring_.close();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

void FrameWorkers::finish(FrameStatistics& sum) {
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
  for (const FrameStatistics& part : statistics_) {
    sum.read_s += part.read_s;
    sum.decode_s += part.decode_s;
    sum.project_s += part.project_s;
    sum.sort_s += part.sort_s;
    sum.workers_waited_s += part.workers_waited_s;
    sum.splats_read += part.splats_read;
    sum.splats_clipped += part.splats_clipped;
    sum.splats_off_screen += part.splats_off_screen;
    sum.splats_transparent += part.splats_transparent;
    sum.splats_drawn += part.splats_drawn;
    sum.bytes_read += part.bytes_read;
  }
  if (first_failure_) std::rethrow_exception(first_failure_);
}

void FrameWorkers::loop(FrameStatistics& statistics) {
  nameThisThread("prepare");
  try {
    WorkerScratch scratch;
    while (true) {
      const uint64_t sequence = next_++;
      if (sequence >= work_.parts.size()) return;
      if (!prepare(scratch, sequence, statistics)) return;
    }
  } catch (...) {
    {
      const std::lock_guard lock(failing_);
      if (!first_failure_) first_failure_ = std::current_exception();
    }
    ring_.close();
  }
}

bool FrameWorkers::prepare(WorkerScratch& scratch, uint64_t sequence, FrameStatistics& statistics) {
  const auto [id, octants] = work_.parts[sequence];
  const Brick& brick = work_.cache.bricks()[id];
  ReadTimes times;
  work_.cache.readGeometry(id, scratch.geometry, nullptr, &times);
  work_.cache.readVariable(id, work_.variable, scratch.values, &times);
  statistics.read_s += times.read_s;
  statistics.decode_s += times.decode_s;
  {
    const StageTimer timer(statistics.project_s);
    const SplatRanges ranges(brick, octants);
    scratch.projector.project(work_.settings, work_.table, work_.cache.manifest().root.cellMin(brick.cell),
                              scratch.geometry, scratch.values, {ranges.begin(), ranges.end()});
  }
  const std::vector<ScreenSplat>& splats = scratch.projector.splats();
  std::span<const uint32_t> order;
  {
    const StageTimer timer(statistics.sort_s);
    order = scratch.sorter.sort(scratch.projector.depths(), work_.order);
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

  const ProjectionCounts& counts = scratch.projector.counts();
  statistics.splats_read += counts.read;
  statistics.splats_clipped += counts.clipped;
  statistics.splats_off_screen += counts.off_screen;
  statistics.splats_transparent += counts.transparent;
  statistics.splats_drawn += counts.drawn;
  statistics.bytes_read +=
      brick.geometry.length + work_.cache.brickVariables(work_.variable)[id].values.length;
  return true;
}

}  // namespace curvisplat
