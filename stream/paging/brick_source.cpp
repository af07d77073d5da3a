#include "stream/paging/brick_source.h"

#include <algorithm>
#include <glm/common.hpp>
#include <unordered_set>
#include <utility>

#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

/// Copies the splats of `kept` to the front of the arrays, in their order.
void compact(std::span<const uint32_t> kept, BrickSource::Scratch& scratch) {
  const auto keep = [&](auto& array) {
    for (size_t n = 0; n < kept.size(); ++n) array[n] = array[kept[n]];
  };
  forEachArrayOfGeometry(scratch.geometry, keep);
  scratch.geometry.resize(kept.size());
  for (SplatVariable* values : {&scratch.values, &scratch.second}) {
    if (values->size() == 0) continue;
    forEachArrayOfVariable(*values, keep);
    values->resize(kept.size());
  }
}

void clear(BrickSource::Scratch& scratch) {
  scratch.geometry.resize(0);
  scratch.values.resize(0);
  scratch.second.resize(0);
}

}  // namespace

BrickSource::BrickSource(const CacheReader& cache, const Variables& variables, const PagerOptions& pager,
                         uint64_t cache_bytes, uint64_t kept_bytes)
    : cache_(cache),
      variable_(variables.first),
      second_(variables.second),
      cached_(cache_bytes, variables.second.has_value()),
      kept_(kept_bytes),
      pager_(cache, variables, pager) {}

const LayerMerging* BrickSource::mergingOf(const BrickPart& part) const {
  return part.merging == 0 ? nullptr : mergings_.at(part.merging - size_t{1}).get();
}

BrickKey BrickSource::keyOf(const BrickPart& part) const {
  const LayerMerging* const merging = mergingOf(part);
  return {part.brick, merging ? merging->number : 0};
}

std::vector<BrickKey> BrickSource::keysOf(std::span<const BrickPart> parts) const {
  std::vector<BrickKey> keys;
  keys.reserve(parts.size());
  for (const BrickPart& part : parts) keys.push_back(keyOf(part));
  return keys;
}

void BrickSource::start(std::span<const BrickPart> parts, BrickPager::Unneeded unneeded,
                        const Mergings& mergings) {
  parts_.assign(parts.begin(), parts.end());
  mergings_ = mergings;
  const std::vector<BrickKey> keys = keysOf(parts);
  cached_.beginEpoch(keys);
  pins_.clear();
  misses_.clear();
  std::vector<uint32_t> to_read;
  for (const BrickKey& key : keys) {
    pins_.push_back(cached_.find(key));
    misses_.push_back(static_cast<uint32_t>(to_read.size()));
    if (!pins_.back()) to_read.push_back(key.brick);
  }
  before_ = pager_.statistics();
  reads_ = to_read.size();
  hits_ = parts.size() - reads_;
  pager_.start(std::move(to_read), std::move(unneeded));
}

std::optional<BrickSource::Splats> BrickSource::fetch(uint64_t sequence, Scratch& scratch) {
  CURVISPLAT_CHECK_OP(sequence, <, parts_.size());
  const BrickPart& part = parts_[sequence];
  if (pins_[sequence]) {
    refresh(*pins_[sequence], part.brick, scratch);
    return splatsOf(*std::exchange(pins_[sequence], {}), part);
  }
  return read(part, misses_[sequence], scratch);
}

void BrickSource::pass(uint64_t sequence) {
  if (!std::exchange(pins_[sequence], {})) pager_.fetch(misses_[sequence]);
}

std::optional<BrickSource::Splats> BrickSource::read(const BrickPart& part, uint64_t miss, Scratch& scratch) {
  std::optional<PagedBrick> bytes = await(miss, scratch);
  if (!bytes) return {};
  if (bytes->isLeftOut()) {
    scratch.geometry.resize(0);
    scratch.values.resize(0);
    scratch.second.resize(0);
    Splats none{arraysOf(std::as_const(scratch.geometry)), arraysOf(std::as_const(scratch.values)),
                SplatRanges(Brick(), kAllOctants), cache_.bricks()[part.brick].cell, std::nullopt};
    if (second_) none.second = arraysOf(std::as_const(scratch.second));
    return none;
  }
  if (!bytes->readable()) {
    // The read may have failed for a neighbour's sake. If not, this says what is wrong.
    bytes.reset();
    return readAlone(part, scratch);
  }
  try {
    if (auto pin = decodeInto(part, *bytes, scratch)) return splatsOf(*std::move(pin), part);
    return splatsOf(scratch, part);
  } catch (const DamagedBrick&) {
    // io_uring can have given other bytes than the file has (FUSE with direct_io and short reads, Linux 6.18). If not, this
    // says what is wrong.
  }
  bytes.reset();
  return readAlone(part, scratch);
}

/// Decodes a part into the cache if that has space, otherwise into the scratch.
std::optional<BrickCache::Pin> BrickSource::decodeInto(const BrickPart& part, const PagedBrick& bytes,
                                                       Scratch& scratch) {
  if (!mergingOf(part)) {
    if (auto slot = cached_.makeSlot(part.brick, cache_.bricks()[part.brick].splats)) {
      decode(part.brick, bytes, *slot, scratch);
      return std::move(*slot).keep();
    }
    decode(part.brick, bytes, scratch);
    return {};
  }
  decode(part.brick, bytes, scratch);
  merge(part, scratch);
  auto slot = cached_.makeSlot(keyOf(part), static_cast<uint32_t>(scratch.geometry.size()));
  if (!slot) return {};
  copyGeometry(arraysOf(std::as_const(scratch.geometry)), slot->geometry());
  copyValues(arraysOf(std::as_const(scratch.values)), slot->values());
  if (second_) copyValues(arraysOf(std::as_const(scratch.second)), slot->second());
  return std::move(*slot).keep();
}

void BrickSource::merge(const BrickPart& part, Scratch& scratch) const {
  const LayerMerging* const merging = mergingOf(part);
  if (!merging) return;
  const TraceScope trace("merge layers");
  scratch.merger.merge(*merging, cache_.bricks()[part.brick].largest_radius, scratch.geometry, scratch.values,
                       second_ ? &scratch.second : nullptr);
}

/// The values of a brick whose geometry is there, of this step. They are read by the worker: a few pages, which the
/// prefetch of the step has usually brought into memory.
void BrickSource::refresh(const BrickCache::Pin& pin, uint32_t brick, Scratch& scratch) {
  pin.refresh([&](const VariableArrays<float>& values, const VariableArrays<float>& second) {
    // Both are read before either is replaced.
    cache_.readVariable(brick, variable_, scratch.values, &scratch.times, &kept_);
    if (second_) {
      cache_.readVariable(brick, *second_, scratch.second, &scratch.times, &kept_);
      copyValues(arraysOf(std::as_const(scratch.second)), second);
    }
    copyValues(arraysOf(std::as_const(scratch.values)), values);
  });
}

void BrickSource::stepChanged() {
  pager_.stop();
  pins_.clear();
  pager_.stepChanged();
  cached_.stepChanged();
}

/// Reads a part in this thread, without the pager.
BrickSource::Splats BrickSource::readAlone(const BrickPart& part, Scratch& scratch) const {
  cache_.readGeometry(part.brick, scratch.geometry, nullptr, &scratch.times);
  cache_.readVariable(part.brick, variable_, scratch.values, &scratch.times);
  if (second_) cache_.readVariable(part.brick, *second_, scratch.second, &scratch.times);
  merge(part, scratch);
  return splatsOf(scratch, part);
}

/// The splats of a part that are there: those that layers were merged to, or those that are stored.
SplatRanges BrickSource::rangesOf(const BrickPart& part, size_t decoded) const {
  if (!mergingOf(part)) return {cache_.bricks()[part.brick], part.octants};
  Brick merged;
  merged.splats = static_cast<uint32_t>(decoded);
  return {merged, kAllOctants};
}

BrickSource::Splats BrickSource::splatsOf(BrickCache::Pin pin, const BrickPart& part) const {
  const Brick& brick = cache_.bricks()[part.brick];
  const auto second = second_ ? std::optional(pin.second()) : std::nullopt;
  const SplatRanges ranges = rangesOf(part, pin.geometry().size());
  return {pin.geometry(), pin.values(), ranges, brick.cell, std::move(pin), second};
}

BrickSource::Splats BrickSource::splatsOf(const Scratch& scratch, const BrickPart& part) const {
  const Brick& brick = cache_.bricks()[part.brick];
  const auto second = second_ ? std::optional(arraysOf(scratch.second)) : std::nullopt;
  return {arraysOf(scratch.geometry),
          arraysOf(scratch.values),
          rangesOf(part, scratch.geometry.size()),
          brick.cell,
          std::nullopt,
          second};
}

std::optional<PagedBrick> BrickSource::await(uint64_t miss, Scratch& scratch) {
  const WaitTimer timer(scratch.waited_s, "wait for a brick");
  return pager_.fetch(miss);
}

void BrickSource::decode(uint32_t brick, const PagedBrick& bytes, const BrickCache::Slot& slot,
                         Scratch& scratch) {
  cache_.decode(brick, bytes.geometry(), slot.geometry(), scratch.times);
  cache_.decode(brick, variable_, bytes.values(), slot.values(), scratch.times, &kept_);
  if (second_) cache_.decode(brick, *second_, bytes.second(), slot.second(), scratch.times, &kept_);
}

void BrickSource::decode(uint32_t brick, const PagedBrick& bytes, Scratch& scratch) {
  const uint32_t splats = cache_.bricks()[brick].splats;
  scratch.geometry.resize(splats);
  scratch.values.resize(splats);
  cache_.decode(brick, bytes.geometry(), arraysOf(scratch.geometry), scratch.times);
  cache_.decode(brick, variable_, bytes.values(), arraysOf(scratch.values), scratch.times, &kept_);
  if (!second_) return;
  scratch.second.resize(splats);
  cache_.decode(brick, *second_, bytes.second(), arraysOf(scratch.second), scratch.times, &kept_);
}

BrickSource::Splats BrickSource::standIn(const BrickPart& part, Scratch& scratch) const {
  const auto bricks = cache_.bricks();
  Brick stored;  // what is in the scratch
  stored.cell = bricks[part.brick].cell;
  clear(scratch);
  for (uint32_t ancestor = bricks[part.brick].parent; ancestor != kNoBrick;
       ancestor = bricks[ancestor].parent) {
    try {
      readAncestor(ancestor, scratch);
    } catch (const DamagedBrick&) {
      clear(scratch);
      continue;  // the next one, then
    }
    keepPart(part, ancestor, scratch);
    stored.cell = bricks[ancestor].cell;
    break;
  }
  stored.splats = static_cast<uint32_t>(scratch.geometry.size());
  const SplatGeometry& geometry = scratch.geometry;
  const SplatVariable& values = scratch.values;
  Splats splats{arraysOf(geometry), arraysOf(values), SplatRanges(stored, kAllOctants), stored.cell,
                std::nullopt};
  if (second_) splats.second = arraysOf(std::as_const(scratch.second));
  return splats;
}

void BrickSource::readAncestor(uint32_t brick, Scratch& scratch) const {
  cache_.readGeometry(brick, scratch.geometry, nullptr, &scratch.times);
  cache_.readVariable(brick, variable_, scratch.values, &scratch.times);
  if (second_) cache_.readVariable(brick, *second_, scratch.second, &scratch.times);
}

/// Keeps of `ancestor`, which is in the scratch, the splats that stand for the space of `part`.
void BrickSource::keepPart(const BrickPart& part, uint32_t ancestor, Scratch& scratch) const {
  const auto bricks = cache_.bricks();
  uint32_t below = part.brick;  // the ancestor's child that holds the brick
  while (bricks[below].parent != ancestor) below = bricks[below].parent;
  const auto octant = static_cast<uint8_t>(1 << bricks[below].cell.octantInParent());

  // An ancestor farther up holds other bricks' space in the octant too.
  const RootCube& root = cache_.manifest().root;
  const Cell& cell = bricks[part.brick].cell;
  const glm::vec3 lower(root.cellMin(cell) - root.cellMin(bricks[ancestor].cell));
  const auto half = static_cast<float>(0.5 * root.cellSize(cell.level));
  const SplatGeometry& g = scratch.geometry;
  const auto stands = [&](uint32_t n) {
    const glm::vec3 at = glm::floor((glm::vec3(g.x[n], g.y[n], g.z[n]) - lower) / half);
    const auto inside = [](float halves) { return halves == 0 || halves == 1; };
    if (!inside(at.x) || !inside(at.y) || !inside(at.z)) return false;
    return (part.octants >> (int(at.x) | int(at.y) << 1 | int(at.z) << 2) & 1) != 0;
  };
  const bool all = part.whole() && below == part.brick;
  std::vector<uint32_t> kept;
  for (const SplatRange& range : SplatRanges(bricks[ancestor], octant))
    for (uint32_t n = range.begin; n < range.end; ++n)
      if (all || stands(n)) kept.push_back(n);
  compact(kept, scratch);

  // A cell that could not be split has several bricks; this one is a part of what is stood in for.
  double of_cell = 0;
  const Brick& above = bricks[bricks[part.brick].parent];
  for (uint32_t child = above.first_child; child < above.first_child + above.child_count; ++child)
    if (bricks[child].cell == cell) of_cell += bricks[child].splats;
  const auto share = static_cast<float>(bricks[part.brick].splats / of_cell);
  for (float& weight : scratch.geometry.weight) weight *= share;
}

void BrickSource::startPrefetch(std::span<const BrickPart> parts, const Mergings& mergings) {
  mergings_ = mergings;
  cached_.beginEpoch(keysOf(parts));
  parts_.clear();
  pins_.clear();
  to_prefetch_.clear();
  to_refresh_.clear();
  uint64_t bytes = 0;
  std::vector<uint32_t> to_read;
  std::unordered_set<uint32_t> seen;
  for (const BrickPart& part : parts) {
    if (!seen.insert(part.brick).second) continue;
    bytes += BrickCache::charge(cache_.bricks()[part.brick].splats, second_.has_value());
    if (bytes > cached_.capacity()) break;
    if (!cached_.contains(keyOf(part))) {
      to_prefetch_.push_back(part);
      to_read.push_back(part.brick);
    } else if (cached_.isStale(keyOf(part))) {
      to_refresh_.push_back(part);
    }
  }
  next_prefetch_ = 0;
  prefetch_stopped_ = false;
  pager_.start(std::move(to_read));
}

bool BrickSource::prefetchNext(Scratch& scratch) {
  uint64_t sequence = next_prefetch_++;
  if (sequence < to_refresh_.size()) {
    if (prefetch_stopped_) return false;
    const BrickPart& part = to_refresh_[sequence];
    if (const auto pin = cached_.find(keyOf(part))) refresh(*pin, part.brick, scratch);
    return true;
  }
  sequence -= to_refresh_.size();
  if (sequence >= to_prefetch_.size()) return false;
  const std::optional<PagedBrick> bytes = await(sequence, scratch);
  if (!bytes) return false;
  if (!bytes->readable()) return true;  // the frame will tell
  try {
    return decodeInto(to_prefetch_[sequence], *bytes, scratch).has_value();
  } catch (const DamagedBrick&) {
    return true;  // the frame reads it again
  }
}

void BrickSource::stop() {
  prefetch_stopped_ = true;
  pager_.stop();
}

void BrickSource::finish(FetchStatistics& statistics) {
  const PagerStatistics after = pager_.statistics();
  pager_.stop();
  pins_.clear();
  statistics.read_by = pager_.way();
  const double depth_s = statistics.mean_queue_depth * statistics.read_s + after.depth_s - before_.depth_s;
  statistics.read_s += after.reading_s - before_.reading_s;
  statistics.mean_queue_depth = statistics.read_s > 0 ? depth_s / statistics.read_s : 0;
  statistics.bytes_read += after.bytes - before_.bytes;
  statistics.read_requests += after.requests - before_.requests;
  statistics.bricks_cached += hits_;
  statistics.bricks_left_out += after.bricks_left_out - before_.bricks_left_out;
  statistics.bytes_left_out += after.bytes_left_out - before_.bytes_left_out;
  statistics.bricks_read += reads_ - (after.bricks_left_out - before_.bricks_left_out);
  const BrickCache::Statistics kept = cached_.statistics();
  statistics.bricks_resident = kept.bricks;
  statistics.cache_bytes = kept.bytes;
  statistics.kept_bytes = kept_.statistics().bytes;
  statistics.cache_peak_bytes = kept.peak_bytes;
  statistics.pager_peak_bytes = after.peak_bytes;
}

}  // namespace curvisplat
