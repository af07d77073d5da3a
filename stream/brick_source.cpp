#include "stream/brick_source.h"

#include <algorithm>
#include <unordered_set>
#include <utility>

#include "stream/error.h"
#include "stream/stage_timer.h"

namespace curvisplat {
namespace {

/// Each once, in the order in which they come first. Only what is drawn in part comes more than once.
std::vector<uint32_t> bricksOf(std::span<const BrickPart> parts) {
  std::vector<uint32_t> bricks;
  bricks.reserve(parts.size());
  std::unordered_set<uint32_t> in_part;
  for (const BrickPart& part : parts)
    if (part.whole() || in_part.insert(part.brick).second) bricks.push_back(part.brick);
  return bricks;
}

}  // namespace

BrickSource::BrickSource(const CacheReader& cache, size_t variable, const PagerOptions& pager,
                         uint64_t cache_bytes)
    : cache_(cache), variable_(variable), cached_(cache_bytes), pager_(cache, variable, pager) {}

void BrickSource::start(std::vector<BrickPart> parts) {
  parts_ = std::move(parts);
  cached_.beginTurn(bricksOf(parts_));
  pins_.clear();
  misses_.clear();
  pins_.reserve(parts_.size());
  misses_.reserve(parts_.size());
  std::vector<uint32_t> to_read;
  for (const BrickPart& part : parts_) {
    pins_.push_back(cached_.find(part.brick));
    misses_.push_back(static_cast<uint32_t>(to_read.size()));
    if (!pins_.back()) to_read.push_back(part.brick);
  }
  before_ = pager_.statistics();
  reads_ = to_read.size();
  pager_.start(std::move(to_read));
}

std::optional<BrickSource::Splats> BrickSource::take(uint64_t sequence, Scratch& scratch) {
  CURVISPLAT_CHECK_OP(sequence, <, parts_.size());
  const auto [brick, octants] = parts_[sequence];
  const Brick& record = cache_.bricks()[brick];
  const SplatRanges ranges(record, octants);
  const auto pinned = [&](BrickCache::Pin pin) {
    return Splats{pin.geometry(), pin.values(), record.cell, ranges, std::move(pin)};
  };
  if (std::optional<BrickCache::Pin>& pin = pins_[sequence]) return pinned(*std::exchange(pin, {}));
  std::optional<PagedBrick> bytes = await(misses_[sequence], scratch);
  if (!bytes) return {};
  if (!bytes->readable()) {
    // The read may have failed for a neighbour's sake. If not, this says what is wrong.
    bytes.reset();
    cache_.readGeometry(brick, scratch.geometry, nullptr, &scratch.times);
    cache_.readVariable(brick, variable_, scratch.values, &scratch.times);
  } else if (auto room = cached_.makeRoom(brick, record.splats)) {
    decode(brick, *bytes, room->geometry(), room->values(), scratch);
    return pinned(std::move(*room).keep());
  } else {
    scratch.geometry.resize(record.splats);
    scratch.values.resize(record.splats);
    decode(brick, *bytes, arraysOf(scratch.geometry), arraysOf(scratch.values), scratch);
  }
  return Splats{arraysOf(std::as_const(scratch.geometry)), arraysOf(std::as_const(scratch.values)),
                record.cell, ranges, std::nullopt};
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

std::optional<BrickSource::Splats> BrickSource::standIn(const BrickPart& part, Scratch& scratch) const {
  const auto bricks = cache_.bricks();
  for (uint32_t ancestor = bricks[part.brick].parent; ancestor != kNoBrick;
       ancestor = bricks[ancestor].parent) {
    try {
      cache_.readGeometry(ancestor, scratch.geometry, nullptr, &scratch.times);
      cache_.readVariable(ancestor, variable_, scratch.values, &scratch.times);
    } catch (const Error&) {
      continue;  // the next one, then
    }
    const SplatRanges ranges = weighFor(part, ancestor, scratch.geometry);
    return Splats{arraysOf(std::as_const(scratch.geometry)), arraysOf(std::as_const(scratch.values)),
                  bricks[ancestor].cell, ranges, std::nullopt};
  }
  return {};
}

/// What stands for `part` in `ancestor`, whose splats `geometry` are: the octant that holds the part's brick.
/// Splats of it that stand for other bricks too lose their weight.
SplatRanges BrickSource::weighFor(const BrickPart& part, uint32_t ancestor, SplatGeometry& geometry) const {
  const auto bricks = cache_.bricks();
  uint32_t below = part.brick;  // the ancestor's child that holds the brick
  while (bricks[below].parent != ancestor) below = bricks[below].parent;
  const auto octant = static_cast<uint8_t>(1 << bricks[below].cell.octantInParent());
  const SplatRanges ranges(bricks[ancestor], octant);

  // An ancestor farther up holds other bricks' space in the octant too, and of a brick that is drawn in part
  // the other octants are drawn from its children.
  const RootCube& root = cache_.manifest().root;
  const Cell& cell = bricks[part.brick].cell;
  const glm::vec3 lower(root.cellMin(cell) - root.cellMin(bricks[ancestor].cell));
  const auto size = static_cast<float>(root.cellSize(cell.level));
  const glm::vec3 middle = lower + 0.5f * size, upper = lower + size;
  const bool is_child = below == part.brick;
  const auto standsForPart = [&](float x, float y, float z) {
    if (!is_child &&
        !(x >= lower.x && x < upper.x && y >= lower.y && y < upper.y && z >= lower.z && z < upper.z))
      return false;
    const int of_brick = (x >= middle.x) | (y >= middle.y) << 1 | (z >= middle.z) << 2;
    return (part.octants >> of_brick & 1) != 0;
  };
  const float share = shareOfCell(part.brick);
  for (const SplatRange& range : ranges)
    for (uint32_t n = range.begin; n < range.end; ++n)
      geometry.weight[n] *= standsForPart(geometry.x[n], geometry.y[n], geometry.z[n]) ? share : 0;
  return ranges;
}

/// A cell that could not be split has several bricks; each is a part of what is stood in for. `brick` has a
/// parent.
float BrickSource::shareOfCell(uint32_t brick) const {
  const auto bricks = cache_.bricks();
  const Brick& above = bricks[bricks[brick].parent];
  double of_cell = 0;
  for (uint32_t child = above.first_child; child < above.first_child + above.child_count; ++child)
    if (bricks[child].cell == bricks[brick].cell) of_cell += bricks[child].splats;
  return static_cast<float>(bricks[brick].splats / of_cell);
}

void BrickSource::startPrefetch(std::span<const BrickPart> parts) {
  const std::vector<uint32_t> bricks = bricksOf(parts);
  cached_.beginTurn(bricks);
  pins_.clear();
  wanted_.clear();
  uint64_t bytes = 0;
  for (const uint32_t brick : bricks) {
    bytes += BrickCache::charge(cache_.bricks()[brick].splats);
    if (bytes > cached_.capacity()) break;
    if (!cached_.contains(brick)) wanted_.push_back(brick);
  }
  next_prefetch_ = 0;
  pager_.start(wanted_);
}

bool BrickSource::prefetchNext(Scratch& scratch) {
  const uint64_t sequence = next_prefetch_++;
  if (sequence >= wanted_.size()) return false;
  const std::optional<PagedBrick> bytes = await(sequence, scratch);
  if (!bytes) return false;
  const uint32_t brick = wanted_[sequence];
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
  statistics.bricks_cached = parts_.size() - reads_;
  statistics.bricks_read = reads_;
  statistics.cache_peak_bytes = cached_.statistics().peak_bytes;
  statistics.pager_peak_bytes = after.peak_bytes;
}

}  // namespace curvisplat
