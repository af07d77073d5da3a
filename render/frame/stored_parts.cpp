// The parts of a frame that are drawn from the painter's store of bricks, where it has one.
#include <algorithm>
#include <vector>

#include "render/frame/frame_pipeline.h"
#include "render/frame/frame_workers.h"
#include "render/project/brick_store.h"
#include "stream/base/mutex.h"

namespace curvisplat {

/// Chooses the parts that are drawn from the painter's store, if it has one, and sends what is missing there. The choice depends
/// on nothing but the plan and the card's memory, and so do the picture's bits.
void FramePipeline::fillStore(const FramePlan& plan, const FrameOptions& options,
                              FrameStatistics& statistics) {
  stored_.clear();
  left_.clear();
  unread_.clear();
  if (painting_ != backend_.get() || options.ranks || options.keep_going || coloured_by_ ||
      !BrickStore::canDraw(plan.settings))
    return;
  std::vector<uint32_t> numbers;
  for (uint32_t number = 0; number < plan.parts.size(); ++number) {
    const SweptPart& part = plan.parts[number];
    const Brick& brick = cache_.bricks()[part.part.brick];
    const glm::dvec3 cell_min = cache_.manifest().root.cellMin(brick.cell);
    if (!BrickStore::canDraw(brick, cell_min, plan.settings)) continue;
    numbers.push_back(number);
    stored_.push_back(
        {part.part.brick, brick.splats, SplatRanges(brick, part.part.octants), cell_min, part.keys});
  }
  std::vector<StoredPart> missing;
  painting_->run([&](Painter& painter) {
    BrickStore* const store = painter.store();
    const uint64_t bytes = store ? options.card_memory_bytes.value_or(store->defaultBytes()) : 0;
    if (store) store->open(content_);
    const size_t fitting = store ? store->makeRoom(stored_, bytes) : 0;
    stored_.erase(stored_.begin() + static_cast<std::ptrdiff_t>(fitting), stored_.end());
    for (const StoredPart& part : stored_)
      if (!store->has(part.brick)) missing.push_back(part);
  });
  if (stored_.empty()) return;
  if (!missing.empty()) putIntoStore(missing, options, statistics);
  left_.assign(plan.parts.size(), LeftToWorkers::kAll);
  painting_->run([&](Painter& painter) {
    for (size_t n = 0; n < stored_.size(); ++n) {
      const bool pieces = painter.store()->hasPieces(stored_[n].brick);
      left_[numbers[n]] = pieces ? LeftToWorkers::kPieces : LeftToWorkers::kNothing;
      if (!pieces) unread_.push_back(stored_[n].brick);
    }
  });
  std::sort(unread_.begin(), unread_.end());
}

/// Has the workers fetch and decode the bricks of the parts, which go to the painter's thread one after the other.
void FramePipeline::putIntoStore(std::span<const StoredPart> parts, const FrameOptions& options,
                                 FrameStatistics& statistics) {
  std::vector<BrickPart> bricks;
  for (const StoredPart& part : parts) bricks.push_back({part.brick});
  Mutex putting;
  const auto put = [&](size_t part, const glm::dvec3&, const BrickSource::Splats& splats) {
    const MutexLock lock(putting);
    painting_->run(
        [&](Painter& painter) { painter.store()->put(parts[part].brick, splats.geometry, splats.values); });
  };
  sample({cache_, bricks, put}, options, statistics);
}

}  // namespace curvisplat
