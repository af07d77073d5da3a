// The parts of a frame that are drawn from the painter's store of bricks, where it has one.
#include <algorithm>
#include <vector>

#include "render/frame/frame_pipeline.h"
#include "render/frame/frame_workers.h"
#include "render/project/brick_store.h"
#include "render/project/pixel_layers.h"
#include "render/sweep/hidden_bricks.h"
#include "stream/base/mutex.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

/// The splats at borders that a worker may divide while another one does. Their pieces take a few MiB, which its
/// projector leaves unused meanwhile; more would pass --memory with many workers.
constexpr size_t kMaxDividedAside = 8192;

/// Whether some splat of the brick may lie across or behind the layers of its pixels.
bool meetsLayers(const Brick& brick, const ProjectionSettings& settings) {
  if (!settings.layers) return false;
  const PixelLayers& layers = *settings.layers;
  const double nearest = layers.boundsOver(screenBoxOf(brick, settings.view)).nearest;
  return farthestDepthOf(brick, settings.view) - layers.depthOrigin() > nearest;
}

/// The card's memory of the layers of all pixels, which bricks leave free: four depths, and a window's picture has their colours
/// there too, in as many textures as there are windows of depth, or fewer.
uint64_t layerBytes(const FramePlan& plan, bool on_card) {
  const PixelLayers* const layers = plan.settings.layers;
  if (!layers || layers->empty()) return 0;
  const auto textures = 1 + (on_card ? static_cast<uint64_t>(layers->windows()) : 0);
  return textures * 4 * sizeof(float) * layers->size().pixels();
}

}  // namespace

/// Chooses the parts that are drawn from the painter's store, if it has one, and sends what is missing there. The choice depends
/// on nothing but the plan, the card's memory and whether the picture stays there, and so do the picture's bits.
void FramePipeline::fillStore(const FramePlan& plan, const FrameOptions& options, bool on_card,
                              FrameStatistics& statistics) {
  stored_.clear();
  is_stored_.clear();
  unread_.clear();
  if (painting_ != backend_.get()) return;  // after a picture of the same splats
  is_storing_ = false;
  if (!options.ranks->alone() || options.keep_going) return;
  std::vector<uint32_t> numbers;
  for (uint32_t number = 0; number < plan.parts.size(); ++number) {
    const SweptPart& part = plan.parts[number];
    const Brick& brick = cache_.bricks()[part.part.brick];
    const glm::dvec3 cell_min = cache_.manifest().root.cellMin(brick.cell);
    if (!BrickStore::canDraw(brick, cell_min, plan.settings.view)) continue;
    numbers.push_back(number);
    stored_.push_back({part.part.brick, brick.splats, brick.octant_splats,
                       SplatRanges(brick, part.part.octants), cell_min, part.keys,
                       BrickStore::clipsOf(brick, plan.settings), meetsLayers(brick, plan.settings),
                       coloured_by_.has_value()});
  }
  // Bricks that are put tell how much room they need, so that fewer of the parts may fit than it seemed.
  for (;;) {
    std::vector<StoredPart> missing;
    painting_->run([&](Painter& painter) {
      BrickStore* const store = painter.store();
      uint64_t bytes = store ? options.card_memory_bytes.value_or(store->defaultBytes()) : 0;
      bytes -= std::min(bytes, layerBytes(plan, on_card));
      is_storing_ = bytes > 0;
      if (store) store->open(content_, cache_.position());
      const size_t fitting = store ? store->makeRoom(stored_, bytes) : 0;
      stored_.erase(stored_.begin() + static_cast<std::ptrdiff_t>(fitting), stored_.end());
      for (const StoredPart& part : stored_)
        if (!store->has(part.brick)) missing.push_back(part);
    });
    if (missing.empty()) break;
    putIntoStore(missing, plan.settings.borders, options, statistics);
  }
  if (stored_.empty()) return;
  is_stored_.assign(plan.parts.size(), 0);
  for (size_t n = 0; n < stored_.size(); ++n) {
    is_stored_[numbers[n]] = 1;
    unread_.push_back(stored_[n].brick);
  }
  std::sort(unread_.begin(), unread_.end());
}

/// Has the workers fetch and decode the bricks of the parts, which go to the painter's thread one after the other.
void FramePipeline::putIntoStore(std::span<const StoredPart> parts, const BorderStyle& borders,
                                 const FrameOptions& options, FrameStatistics& statistics) {
  std::vector<BrickPart> bricks;
  for (const StoredPart& part : parts) bricks.push_back({part.brick});
  Mutex putting;
  const auto put = [&](size_t part, const glm::dvec3&, const BrickSource::Splats& splats) {
    const auto send = [&](const BrickPieces& pieces) {
      painting_->run([&](Painter& painter) {
        painter.store()->put(parts[part], splats.geometry, {splats.values, splats.second}, pieces);
      });
    };
    const uint32_t* const codes = splats.geometry.border_code;
    const auto inner = std::count(codes, codes + splats.geometry.size(), kNoBorder);
    if (splats.geometry.size() - static_cast<size_t>(inner) <= kMaxDividedAside) {
      const BrickPieces pieces = BrickPieces::of(splats.geometry, splats.values, borders);
      const MutexLock lock(putting);
      send(pieces);
    } else {
      const MutexLock lock(putting);
      send(BrickPieces::of(splats.geometry, splats.values, borders));
    }
  };
  sample({cache_, bricks, put}, options, statistics);
}

}  // namespace curvisplat
