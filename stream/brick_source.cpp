#include "stream/brick_source.h"

#include <algorithm>
#include <utility>

#include "stream/error.h"
#include "stream/stage_timer.h"

namespace curvisplat {
namespace {

/// Copies the splats of `kept` to the front of the arrays, in their order.
void compact(std::span<const uint32_t> kept, SplatGeometry& g, SplatVariable& v) {
  for (auto* array : {&g.x, &g.y, &g.z, &g.axis0, &g.axis1, &g.axis2, &g.shear10, &g.shear20, &g.shear21,
                      &g.weight, &v.mean, &v.slope0, &v.slope1, &v.slope2, &v.variance})
    for (size_t n = 0; n < kept.size(); ++n) (*array)[n] = (*array)[kept[n]];
  g.resize(kept.size());
  v.resize(kept.size());
}

}  // namespace

BrickSource::BrickSource(const CacheReader& cache, size_t variable, const PagerOptions& pager,
                         uint64_t cache_bytes)
    : cache_(cache), variable_(variable), cached_(cache_bytes), pager_(cache, variable, pager) {}

void BrickSource::start(std::vector<uint32_t> bricks) {
  bricks_ = std::move(bricks);
  cached_.beginTurn(bricks_);
  pins_.clear();
  misses_.clear();
  std::vector<uint32_t> to_read;
  for (const uint32_t brick : bricks_) {
    pins_.push_back(cached_.find(brick));
    misses_.push_back(static_cast<uint32_t>(to_read.size()));
    if (!pins_.back()) to_read.push_back(brick);
  }
  before_ = pager_.statistics();
  reads_ = to_read.size();
  pager_.start(std::move(to_read));
}

std::optional<BrickSource::Splats> BrickSource::take(uint64_t sequence, Scratch& scratch) {
  CURVISPLAT_CHECK_OP(sequence, <, bricks_.size());
  const uint32_t brick = bricks_[sequence];
  const Brick& record = cache_.bricks()[brick];
  if (std::optional<BrickCache::Pin>& pin = pins_[sequence]) {
    std::optional<BrickCache::Pin> taken = std::exchange(pin, {});
    return Splats{taken->geometry(), taken->values(), record.cell, std::move(taken)};
  }
  std::optional<PagedBrick> bytes = await(misses_[sequence], scratch);
  if (!bytes) return {};
  if (!bytes->readable()) {
    // The read may have failed for a neighbour's sake. If not, this says what is wrong.
    bytes.reset();
    cache_.readGeometry(brick, scratch.geometry, nullptr, &scratch.times);
    cache_.readVariable(brick, variable_, scratch.values, &scratch.times);
    return Splats{arraysOf(std::as_const(scratch.geometry)), arraysOf(std::as_const(scratch.values)),
                  record.cell, std::nullopt};
  }
  if (auto room = cached_.makeRoom(brick, record.splats)) {
    decode(brick, *bytes, room->geometry(), room->values(), scratch);
    std::optional<BrickCache::Pin> pin = std::move(*room).keep();
    return Splats{pin->geometry(), pin->values(), record.cell, std::move(pin)};
  }
  scratch.geometry.resize(record.splats);
  scratch.values.resize(record.splats);
  decode(brick, *bytes, arraysOf(scratch.geometry), arraysOf(scratch.values), scratch);
  return Splats{arraysOf(std::as_const(scratch.geometry)), arraysOf(std::as_const(scratch.values)),
                record.cell, std::nullopt};
}

std::optional<PagedBrick> BrickSource::await(uint64_t miss, Scratch& scratch) {
  const StageTimer timer(scratch.waited_s);
  return pager_.take(miss);
}

void BrickSource::decode(uint32_t brick, const PagedBrick& bytes, const GeometryArrays<float>& geometry,
                         const VariableArrays<float>& values, Scratch& scratch) const {
  cache_.decode(brick, bytes.geometry(), geometry, scratch.times);
  cache_.decode(brick, variable_, bytes.values(), values, scratch.times);
}

std::optional<BrickSource::Splats> BrickSource::standIn(uint32_t brick, Scratch& scratch) const {
  const auto bricks = cache_.bricks();
  for (uint32_t ancestor = bricks[brick].parent; ancestor != kNoBrick; ancestor = bricks[ancestor].parent) {
    try {
      cache_.readGeometry(ancestor, scratch.geometry, nullptr, &scratch.times);
      cache_.readVariable(ancestor, variable_, scratch.values, &scratch.times);
    } catch (const Error&) {
      continue;  // the next one, then
    }
    keepOctant(brick, ancestor, scratch);
    return Splats{arraysOf(std::as_const(scratch.geometry)), arraysOf(std::as_const(scratch.values)),
                  bricks[ancestor].cell, std::nullopt};
  }
  return {};
}

/// Of `ancestor` in the scratch, what stands for the cell of `brick`.
void BrickSource::keepOctant(uint32_t brick, uint32_t ancestor, Scratch& scratch) const {
  const auto bricks = cache_.bricks();
  uint32_t below = brick;  // the ancestor's child that holds the brick
  while (bricks[below].parent != ancestor) below = bricks[below].parent;
  const auto& octants = bricks[ancestor].octant_splats;
  const int octant = bricks[below].cell.octantInParent();
  uint32_t first = 0;
  for (int before = 0; before < octant; ++before) first += octants[before];

  // An ancestor farther up holds other bricks' space in the octant too.
  const RootCube& root = cache_.manifest().root;
  const Cell& cell = bricks[brick].cell;
  const glm::vec3 lower(root.cellMin(cell) - root.cellMin(bricks[ancestor].cell));
  const glm::vec3 upper = lower + static_cast<float>(root.cellSize(cell.level));
  const bool parent = below == brick;
  const SplatGeometry& g = scratch.geometry;
  std::vector<uint32_t> kept;
  for (uint32_t n = first; n < first + octants[octant]; ++n)
    if (parent || (g.x[n] >= lower.x && g.x[n] < upper.x && g.y[n] >= lower.y && g.y[n] < upper.y &&
                   g.z[n] >= lower.z && g.z[n] < upper.z))
      kept.push_back(n);
  compact(kept, scratch.geometry, scratch.values);

  // A cell that could not be split has several bricks; this one is a part of what is stood in for.
  double of_cell = 0;
  const Brick& above = bricks[bricks[brick].parent];
  for (uint32_t child = above.first_child; child < above.first_child + above.child_count; ++child)
    if (bricks[child].cell == cell) of_cell += bricks[child].splats;
  const auto share = static_cast<float>(bricks[brick].splats / of_cell);
  for (float& weight : scratch.geometry.weight) weight *= share;
}

void BrickSource::startPrefetch(const std::vector<uint32_t>& bricks) {
  cached_.beginTurn(bricks);
  pins_.clear();
  bricks_.clear();
  uint64_t bytes = 0;
  for (const uint32_t brick : bricks) {
    bytes += BrickCache::charge(cache_.bricks()[brick].splats);
    if (bytes > cached_.capacity()) break;
    if (!cached_.contains(brick)) bricks_.push_back(brick);
  }
  next_prefetch_ = 0;
  pager_.start(bricks_);
}

bool BrickSource::prefetchNext(Scratch& scratch) {
  const uint64_t sequence = next_prefetch_++;
  if (sequence >= bricks_.size()) return false;
  const std::optional<PagedBrick> bytes = await(sequence, scratch);
  if (!bytes) return false;
  const uint32_t brick = bricks_[sequence];
  if (!bytes->readable()) return true;  // the frame will tell
  auto room = cached_.makeRoom(brick, cache_.bricks()[brick].splats);
  if (!room) return false;
  decode(brick, *bytes, room->geometry(), room->values(), scratch);
  std::move(*room).keep();
  return true;
}

void BrickSource::stop() {
  pager_.stop();
}

void BrickSource::finish(FetchStatistics& statistics) {
  const PagerStatistics after = pager_.statistics();
  pager_.stop();
  pins_.clear();
  statistics.way = pager_.way();
  statistics.reading_s = after.reading_s - before_.reading_s;
  statistics.mean_queue_depth =
      statistics.reading_s > 0 ? (after.depth_s - before_.depth_s) / statistics.reading_s : 0;
  statistics.bytes_read = after.bytes - before_.bytes;
  statistics.read_requests = after.requests - before_.requests;
  statistics.bricks_cached = bricks_.size() - reads_;
  statistics.bricks_read = reads_;
  statistics.cache_peak_bytes = cached_.statistics().peak_bytes;
  statistics.pager_peak_bytes = after.peak_bytes;
}

}  // namespace curvisplat
