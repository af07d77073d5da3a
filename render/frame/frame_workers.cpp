#include "render/frame/frame_workers.h"

#include <algorithm>

#include "render/project/depth_sort.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"

namespace curvisplat {

void add(PrepareStatistics& statistics, const ProjectionCounts& counts) {
  statistics.splats_read += counts.read;
  statistics.splats_clipped += counts.clipped;
  statistics.splats_behind += counts.hidden;
  statistics.splats_off_screen += counts.off_screen;
  statistics.splats_transparent += counts.transparent;
  statistics.splats_drawn += counts.drawn;
}

/// The buffers that a worker keeps from brick to brick, so that preparing a brick allocates nothing.
struct FrameWorkers::Worker {
  BrickSource::Scratch scratch;
  BrickProjector projector;
  std::vector<uint32_t> keys;
  DepthSorter sorter;        // of a brick
  DepthSorter batch_sorter;  // has its turn while a brick waits for space
  PrepareStatistics statistics;
};

FrameWorkers::FrameWorkers(BrickSource& source, SweepBuffer& sweep, SegmentRing& ring,
                           ComputePermits& permits, unsigned count)
    : source_(source), sweep_(sweep), ring_(ring), permits_(permits), team_(count, "prepare") {
  for (unsigned n = 0; n < count; ++n) workers_.push_back(std::make_unique<Worker>());
}

FrameWorkers::~FrameWorkers() {
  stop();
}

void FrameWorkers::stop() {
  sweep_.close();
  ring_.close();
  source_.stop();
}

void FrameWorkers::beginFrame(const FrameWork& work) {
  work_ = &work;
  seen_.assign(work.parts.size(), Seen::kNo);
  prepared_.assign(work.exchange ? work.exchange->parts().size() : 0, 0);
  if (work.exchange && !exchanging_) exchanging_ = std::make_unique<WorkerTeam>(1, "exchange");
  parts_seen_ = 0;
}

void FrameWorkers::start(const TileSet* tiles) {
  begin();
  tiles_ = work_->exchange ? nullptr : tiles;
  if (work_->exchange)
    exchanging_->start([this](unsigned) { exchangeLoop(); });
  else
    run(Urgency::kUrgent, [this](Worker& worker) { loop(worker); });
}

void FrameWorkers::startSampling(const SamplingWork& work) {
  begin();
  run(Urgency::kUrgent, [this, work](Worker& worker) { sample(worker, work); });
}

/// Starts `job` on all threads; each holds a permit except where it waits.
template <typename Job>
void FrameWorkers::run(Urgency urgency, const Job& job) {
  team_.start([this, urgency, job](unsigned number) {
    const Computing computing(&permits_, urgency);
    job(*workers_[number]);
  });
}

void FrameWorkers::begin() {
  next_ = 0;
  {
    const MutexLock lock(failing_);
    first_failure_ = nullptr;
  }
  for (auto& worker : workers_) {
    worker->statistics = {};
    worker->scratch.times = {};
    worker->scratch.waited_s = 0;
  }
}

void FrameWorkers::finish(FrameStatistics& statistics) {
  if (exchanging_) exchanging_->wait();
  team_.wait();
  for (const auto& worker : workers_) {
    combine(statistics, worker->statistics);
    statistics.verify_s += worker->scratch.times.verify_s;
    statistics.decode_s += worker->scratch.times.decode_s;
    statistics.read_waited_s += worker->scratch.waited_s;
  }
  const MutexLock lock(failing_);
  if (first_failure_) std::rethrow_exception(first_failure_);
}

void FrameWorkers::startPrefetch() {
  run(Urgency::kNormal, [this](Worker& worker) {
    try {
      while (source_.prefetchNext(worker.scratch)) Computing::giveWay();
    } catch (...) {
      // The frame will report a damaged brick. The other bricks can wait for the frame too.
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
      if (const auto batch = sweep_.next()) {
        if (!submit(worker, *batch)) return;
        continue;
      }
      const uint64_t sequence = next_++;
      if (sequence >= sweep_.parts().size()) break;
      if (!prepare(worker, sequence)) return;
    }
    endSlab(worker);
  } catch (...) {
    fail();
  }
}

/// Submits what is left of a slab that has all its parts.
void FrameWorkers::endSlab(Worker& worker) {
  while (true) {
    std::optional<SweepBuffer::Batch> batch;
    {
      const WaitTimer timer(worker.statistics.workers_waited_s, "wait for a batch");
      batch = sweep_.awaitNext();
    }
    if (!batch) break;
    if (!submit(worker, *batch)) return;
  }
  ring_.pauseAfter(sweep_.batches());
}

/// The thread that exchanges splats. Between two steps all workers enter what has arrived, and prepare more.
void FrameWorkers::exchangeLoop() {
  try {
    const auto step = [this] {
      const StageTimer timer(workers_[0]->statistics.exchange_s, "exchange splats");
      return work_->exchange->step([this](uint64_t sequence) { return isUnneeded(sequence); });
    };
    while (step()) {
      run(Urgency::kUrgent, [this](Worker& worker) { sharedLoop(worker); });
      team_.wait();
      if (ring_.isClosed()) return;
    }
    run(Urgency::kUrgent, [this](Worker& worker) {
      try {
        endSlab(worker);
      } catch (...) {
        fail();
      }
    });
    team_.wait();
  } catch (...) {
    fail();
  }
}

/// Never waits for the painter while the sweep has space: other ranks wait for what this one prepares.
void FrameWorkers::sharedLoop(Worker& worker) {
  try {
    while (true) {
      const bool may_submit = ring_.hasSpaceFor(SweepBuffer::kMaxBatch);
      if (const auto batch = may_submit ? sweep_.next() : std::nullopt) {
        if (!submit(worker, *batch)) return;
      } else if (const auto sequence = work_->exchange->nextReceived()) {
        if (!enterReceived(worker, *sequence)) return;
      } else if (const auto index = work_->exchange->nextToPrepare()) {
        if (!prepareShared(worker, *index)) return;
      } else {
        return;
      }
    }
  } catch (...) {
    fail();
  }
}

/// Prepares a part for the ranks that need it, this one or others.
bool FrameWorkers::prepareShared(Worker& worker, size_t index) {
  SplatExchange& exchange = *work_->exchange;
  const uint32_t number = exchange.toPrepare()[index];
  const SweptPart& part = exchange.parts()[number];
  if (exchange.isUnneeded(part.part.brick)) {
    source_.pass(index);
    exchange.skip(index);
    return true;
  }
  const std::optional<BrickSource::Splats> fetched = fetch(worker, index, part.part, work_->keep_going);
  if (!fetched) return false;
  project(worker, *fetched, part.keys);
  count(worker, prepared_[number] != 0);
  prepared_[number] = 1;
  exchange.submit(index, worker.projector.splats(), worker.keys);
  return true;
}

bool FrameWorkers::enterReceived(Worker& worker, uint64_t sequence) {
  const uint32_t number = sweep_.parts()[sequence];
  const SweptPart& part = work_->parts[number];
  const auto received = work_->exchange->received(sequence);
  if (!received || isUnneeded(sequence)) return passOver(sequence);
  markSeen(number, Seen::kProjected);
  return enter(worker, sequence, part.part.brick, {received->splats, received->keys});
}

/// Whether a part of this slab is hidden, or lies behind the slab's end.
bool FrameWorkers::isUnneeded(uint64_t sequence) {
  const uint32_t number = sweep_.parts()[sequence];
  const SweptPart& part = work_->parts[number];
  if (sweep_.isBehind(part)) return true;
  if (work_->keep_going || !work_->hidden.hides(part.part.brick)) return false;
  markSeen(number, Seen::kHidden);
  return true;
}

/// Keeps the exception that is being handled, if it is the first, and stops all workers.
void FrameWorkers::fail() {
  {
    const MutexLock lock(failing_);
    if (!first_failure_) first_failure_ = std::current_exception();
  }
  stop();
}

void FrameWorkers::sample(Worker& worker, const SamplingWork& work) {
  try {
    for (uint64_t sequence = next_++; sequence < work.parts.size(); sequence = next_++) {
      const auto fetched = fetch(worker, sequence, work.parts[sequence], work.keep_going);
      if (!fetched) return;
      const StageTimer timer(worker.statistics.project_s, "sample splats");
      work.take(sequence, work.cache.manifest().root.cellMin(fetched->cell), *fetched);
    }
  } catch (...) {
    fail();
  }
}

std::optional<BrickSource::Splats> FrameWorkers::fetch(Worker& worker, uint64_t sequence,
                                                       const BrickPart& part, bool keep_going) {
  try {
    return source_.fetch(sequence, worker.scratch);
  } catch (const DamagedBrick& error) {
    if (!keep_going) throw;
    worker.statistics.bricks_unreadable.push_back({part.brick, error.what()});
    return source_.standIn(part, worker.scratch);
  }
}

bool FrameWorkers::prepare(Worker& worker, uint64_t sequence) {
  const uint32_t number = sweep_.parts()[sequence];
  const SweptPart& part = work_->parts[number];
  const bool is_stored = !work_->stored.empty() && work_->stored[number] != 0;
  if (is_stored) markSeen(number, Seen::kProjected);
  if (is_stored || sweep_.isBehind(part)) {
    source_.pass(sequence);
    return passOver(sequence);
  }
  // The ancestor that replaces a damaged brick may reach out of the brick's box. With keep_going nothing is
  // passed over, therefore: the same bricks are found damaged, and the same splats drawn, in any order of
  // work.
  const auto isHidden = [&] { return !work_->keep_going && work_->hidden.hides(part.part.brick); };
  if (isHidden()) {
    markSeen(number, Seen::kHidden);
    source_.pass(sequence);
    return passOver(sequence);
  }
  {
    const std::optional<BrickSource::Splats> fetched = fetch(worker, sequence, part.part, work_->keep_going);
    if (!fetched) return false;
    // The slab's end may have moved since. The source may then have left this part out.
    if (sweep_.isBehind(part)) return passOver(sequence);
    if (isHidden()) {
      markSeen(number, Seen::kHidden);
      return passOver(sequence);
    }
    project(worker, *fetched, part.keys);
  }
  count(worker, seen_[number] == Seen::kProjected);
  markSeen(number, Seen::kProjected);
  return enter(worker, sequence, part.part.brick, {worker.projector.splats(), worker.keys});
}

void FrameWorkers::project(Worker& worker, const BrickSource::Splats& fetched, const KeyRange& keys) {
  const StageTimer timer(worker.statistics.project_s, "project brick");
  const glm::dvec3 cell_min = work_->cache.manifest().root.cellMin(fetched.cell);
  worker.projector.project(work_->settings, work_->table, cell_min, fetched.geometry,
                           {fetched.values, fetched.second}, fetched.ranges);
  if (tiles_) worker.projector.keepTouching(*tiles_);
  worker.keys.resize(worker.projector.depths().size());
  work_->keys.setKeys(worker.projector.mutableSplats(), worker.projector.depths(), cell_min, keys,
                      worker.keys);
}

void FrameWorkers::markSeen(uint32_t number, Seen seen) {
  if (seen_[number] == Seen::kNo) ++parts_seen_;
  seen_[number] = std::max(seen_[number], seen);
}

uint64_t FrameWorkers::partsHidden() const {
  return static_cast<uint64_t>(std::count(seen_.begin(), seen_.end(), Seen::kHidden));
}

/// Adds a projected part to the statistics, in the first slab that it is in only.
void FrameWorkers::count(Worker& worker, bool again) {
  PrepareStatistics& statistics = worker.statistics;
  if (again) {
    ++statistics.bricks_again;
    return;
  }
  add(statistics, worker.projector.counts());
}

/// Ends the turn of a part that is hidden or lies behind the slab.
bool FrameWorkers::passOver(uint64_t sequence) {
  if (!sweep_.awaitTurn(sequence)) return false;
  sweep_.skip();
  return true;
}

/// Enters a part's splats into the sweep.
bool FrameWorkers::enter(Worker& worker, uint64_t sequence, uint32_t brick, const Projected& projected) {
  PrepareStatistics& statistics = worker.statistics;
  std::span<const DepthItem> sorted;
  {
    const TraceNumbers numbers{static_cast<int64_t>(sequence), static_cast<int64_t>(projected.keys.size())};
    const StageTimer timer(statistics.sort_s, "sort brick", TraceKind::kWork, numbers);
    sorted = worker.sorter.sort(projected.keys);
  }
  {
    const WaitTimer timer(statistics.workers_waited_s, "wait for its turn");
    if (!sweep_.awaitTurn(sequence)) return false;
  }
  std::shared_ptr<SweepBuffer::Run> run;
  while (!(run = sweep_.enter(brick, sorted))) {
    if (const auto batch = sweep_.nextFinal()) {
      if (!submit(worker, *batch)) return false;
      continue;
    }
    const WaitTimer timer(statistics.workers_waited_s, "wait for space");
    if (!sweep_.awaitSpace(brick, sorted)) return false;
  }
  const StageTimer timer(statistics.sort_s, "fill sweep");
  sweep_.fill(*run, sorted, projected.splats);
  return true;
}

/// Sorts a batch into its segment of the ring.
bool FrameWorkers::submit(Worker& worker, const SweepBuffer::Batch& batch) {
  std::span<const DepthItem> sorted;
  std::optional<std::span<ScreenSplat>> segment;
  {
    const TraceNumbers numbers{static_cast<int64_t>(batch.turn), static_cast<int64_t>(batch.count)};
    const StageTimer timer(worker.statistics.sort_s, "sort batch", TraceKind::kWork, numbers);
    sweep_.itemsOf(batch, worker.batch_sorter.items(batch.count));
    sorted = worker.batch_sorter.sort();
  }
  {
    const WaitTimer timer(worker.statistics.workers_waited_s, "wait for the ring");
    if (!sweep_.awaitFilled(batch)) return false;
    segment = ring_.acquire(batch.sequence, batch.count);
  }
  if (!segment) return false;
  {
    const TraceNumbers numbers{static_cast<int64_t>(batch.sequence), static_cast<int64_t>(batch.count)};
    const StageTimer timer(worker.statistics.sort_s, "copy batch", TraceKind::kWork, numbers);
    sweep_.copy(sorted, *segment);
    sweep_.giveBack(batch);
  }
  ring_.commit(batch.sequence);
  return true;
}

}  // namespace curvisplat
