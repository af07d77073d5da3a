#include "preprocess/survey/block_overlap.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/bounding_tree.h"
#include "preprocess/survey/overlap_points.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxBlocks = 100'000;
// A smaller share of the smaller block is attributed to rounding, or to curved faces that two blocks
// approximate by different chords.
constexpr double kNegligibleShare = 2e-3;
constexpr size_t kPairsNamed = 4;
constexpr uint64_t kBytesOfPair = 96;  // in a map, and in the result
constexpr uint64_t kMinPoints = 4 * BlockSampling::kMaxPointsOfCell;

/// The slanted box of a block that was read as a whole; nullopt if one of its corners is blanked.
std::optional<SlantedBox> slantedBoxOf(const GridBlock& block, const NodeArrays& nodes) {
  const auto position = [&](size_t n) { return glm::dvec3(nodes.x[n], nodes.y[n], nodes.z[n]); };
  std::array<glm::dvec3, 8> corner;
  for (size_t c = 0; c < corner.size(); ++c) {
    const size_t n = ((c & 4 ? block.nk - 1 : 0) * block.nj + (c & 2 ? block.nj - 1 : 0)) * block.ni +
                     (c & 1 ? block.ni - 1 : 0);
    if (nodes.blank[n]) return std::nullopt;
    corner[c] = position(n);
  }
  return SlantedBox(corner, [&](const auto& visit) {
    for (size_t n = 0; n < nodes.x.size(); ++n)
      if (!nodes.blank[n]) visit(position(n));
  });
}

bool hasCells(const GridBlock& block) {
  return block.ni > 1 && block.nj > 1 && block.nk > 1;
}

/// The volumes that blocks share, as seen by the points of either: a pair's estimate is the larger of the two.
class SharedVolumes {
 public:
  SharedVolumes(std::span<const double> volumes, uint64_t max_pairs)
      : volumes_(volumes), max_pairs_(max_pairs) {}

  /// `other` holds a point of `block`. For each pair in the order of the points.
  void add(uint32_t block, uint32_t other, double volume) { shared_[{block, other}] += volume; }

  /// All points of the blocks before `end` are located: forgets their pairs that share too little. Counts the pairs only
  /// from the moment on when there are too many.
  void finishBlocks(uint32_t end) {
    if (shared_.size() > checked_) {
      std::erase_if(shared_, [&](const auto& entry) {
        const auto [block, other] = entry.first;
        return block < end && other < end && !(entry.second > negligible(block, other));
      });
      checked_ = 2 * shared_.size() + 1000;
    }
    if (too_many_ == 0 && shared_.size() <= max_pairs_) return;
    too_many_ += shared_.size();
    shared_.clear();
  }

  uint64_t bytes() const { return shared_.size() * kBytesOfPair; }
  /// More than all pairs, where they are too many to be held; else 0.
  uint64_t tooMany() const { return too_many_; }

  std::vector<BlockOverlap> overlaps() const {
    std::vector<BlockOverlap> overlaps;
    overlaps.reserve(shared_.size());
    for (const auto& [pair, own] : shared_) {
      const auto [block, other] = pair;
      const auto reverse = shared_.find({other, block});
      if (block > other && reverse != shared_.end()) continue;  // has been looked at
      const double volume = reverse == shared_.end() ? own : std::max(own, reverse->second);
      if (!(volume > negligible(block, other))) continue;
      const double smaller = std::min(volumes_[block], volumes_[other]);
      overlaps.push_back({std::min(block, other), std::max(block, other), std::min(volume, smaller),
                          std::min(1.0, volume / smaller)});
    }
    std::sort(overlaps.begin(), overlaps.end(), [](const BlockOverlap& a, const BlockOverlap& b) {
      return std::pair(a.first, a.second) < std::pair(b.first, b.second);
    });
    return overlaps;
  }

 private:
  double negligible(uint32_t block, uint32_t other) const {
    return kNegligibleShare * std::min(volumes_[block], volumes_[other]);
  }

  const std::span<const double> volumes_;  // [block], as far as they are measured
  const uint64_t max_pairs_;
  std::map<std::pair<uint32_t, uint32_t>, double> shared_;  // (block of points, block of cells)
  size_t checked_ = 1000;
  uint64_t too_many_ = 0;
};

class OverlapSearch {
 public:
  OverlapSearch(const GridSource& source, const OverlapMemory& memory, const Progress& progress)
      : blocks_(source.description().blocks),
        reader_(source, {}, std::nullopt),
        memory_(memory),
        progress_(progress),
        bounds_(blocks_.size()),
        volumes_(blocks_.size()),
        shared_(volumes_, memory.cap_for ? memory.point_bytes / 2 / kBytesOfPair
                                         : std::numeric_limits<uint64_t>::max()) {
    for (const GridBlock& block : blocks_)
      cells_ += static_cast<double>((block.ni - 1) * (block.nj - 1) * (block.nk - 1));
  }

  std::vector<BlockOverlap> find() {
    uint64_t all = 0;
    for (const GridBlock& block : blocks_)
      if (hasCells(block)) all += samplingOf(block).points();
    const bool at_once = all <= memory_.point_bytes / 2 / sizeof(BlockPoint);
    std::vector<BlockPoint> points;
    measure(at_once ? &points : nullptr);
    cutSlabs();
    tree_.emplace(bounds_);
    for (uint32_t block = 0; block < blocks_.size(); ++block)
      meets_.push_back(tree_->anotherTouches(bounds_[block].box, block));
    if (at_once) {
      keepPointsInOthers(points, 0, *tree_);
      points.shrink_to_fit();
      locateInParts(points);
    } else {
      for (Place next; next.block < blocks_.size();) {
        points.clear();
        next = pick(next, points);
        locateInParts(points);
        shared_.finishBlocks(next.block);
      }
    }
    if (shared_.tooMany() > 0)
      throw Error("--memory: the blocks of this grid overlap in up to {} pairs; give at least {} MiB",
                  shared_.tooMany(), (memory_.cap_for(2 * shared_.tooMany() * kBytesOfPair) >> 20) + 1);
    return shared_.overlaps();
  }
  /// The meetings in vain that findOverlaps() reports, after find().
  uint64_t metInVain() const { return met_in_vain_; }

 private:
  /// A cell, and the plane of cells that it is in.
  struct Place {
    uint32_t block = 0;
    uint64_t cell = 0, plane = 0;
  };

  BlockSampling samplingOf(const GridBlock& block) const { return {block, cells_, blocks_.size()}; }

  /// The first pass: the blocks' bounds and, with `points`, all of their sample points and volumes.
  void measure(std::vector<BlockPoint>* points) {
    SlabStream slabs(reader_, memory_.slab_bytes, points ? kCornerHalo : kNoHalo);
    std::optional<BlockSampling> sampling;
    std::optional<PointPicker> picker;
    uint32_t picked = 0;
    const auto finish = [&] {
      if (picker) picker->finish(volumes_[picked], nullptr);
      picker.reset();
    };
    while (const LoadedSlab* loaded = slabs.next()) {
      progress_.throwIfStopped();
      const uint32_t number = loaded->slab.block;
      for (size_t n = 0; n < loaded->nodes.x.size(); ++n)
        if (!loaded->nodes.blank[n])
          bounds_[number].box.add({loaded->nodes.x[n], loaded->nodes.y[n], loaded->nodes.z[n]});
      if (hasCells(blocks_[number]) && loaded->nodes.x.size() == blocks_[number].nodes())
        bounds_[number].slanted = slantedBoxOf(blocks_[number], loaded->nodes);
      if (!points || !hasCells(blocks_[number])) continue;
      if (!picker || picked != number) {
        finish();
        picked = number;
        sampling.emplace(samplingOf(blocks_[number]));
        picker.emplace(blocks_[number], *sampling, CellPart{number, 0, sampling->endOfCells()}, *points);
      }
      picker->add(*loaded);
    }
    finish();
  }

  void cutSlabs() {
    slabs_ = cutIntoSlabs(blocks_, memory_.slab_bytes / slabBytesPerNode(0), kCornerHalo);
    std::erase_if(slabs_, [&](const Slab& slab) { return !hasCells(blocks_[slab.block]); });
    size_t at = 0;
    for (uint32_t block = 0; block <= blocks_.size(); ++block) {
      while (at < slabs_.size() && slabs_[at].block < block) ++at;
      first_slab_.push_back(at);
    }
  }
  std::span<const Slab> slabsOf(uint32_t block) const {
    return std::span(slabs_).subspan(first_slab_[block], first_slab_[block + 1] - first_slab_[block]);
  }

  /// The memory that points may take: the pairs get a quarter, or what they have and an eighth.
  uint64_t bytesForPoints() const {
    const uint64_t all = memory_.point_bytes;
    return all - std::min(all, std::max(all / 4, shared_.bytes() + all / 8));
  }
  /// How many points may be located at a time, beside those in memory.
  uint64_t mostLocated(uint64_t points) const {
    const uint64_t bytes = bytesForPoints(), held = points * sizeof(BlockPoint);
    return std::max<uint64_t>((bytes - std::min(bytes, held)) / PointHolders::kBytesEach, kMinPoints);
  }
  /// How many may be picked and located.
  uint64_t mostPicked() const {
    return std::max<uint64_t>(bytesForPoints() / (sizeof(BlockPoint) + PointHolders::kBytesEach), kMinPoints);
  }

  /// Picks the points that may lie in other blocks, from a cell on, as many as fit. Returns where to go on.
  Place pick(const Place& from, std::vector<BlockPoint>& points) {
    const uint64_t most = mostPicked();
    CellPart part;  // of a block, that is being picked
    std::optional<BlockSampling> sampling;
    std::optional<PointPicker> picker;
    const auto finish = [&] {
      if (picker) picker->finish(volumes_[part.block], &*tree_);
      picker.reset();
      return sampling && part.end < sampling->endOfCells();
    };
    const auto goOn = [&](uint64_t cell) { return Place{part.block, cell, sampling->planeOf(cell)}; };
    points.reserve(most);
    // Slabs of as many blocks as it takes to have enough points.
    std::vector<Slab> wanted;
    uint32_t end = from.block;
    for (uint64_t count = 0; end < blocks_.size() && count <= most; ++end) {
      if (!meets_[end] || !hasCells(blocks_[end])) continue;
      std::ranges::copy_if(slabsOf(end), std::back_inserter(wanted), [&](const Slab& slab) {
        return slab.block > from.block || slab.box.k1 > from.plane;
      });
      count += samplingOf(blocks_[end]).points();
    }
    SlabStream slabs(reader_, memory_.slab_bytes, std::move(wanted));
    while (const LoadedSlab* loaded = slabs.next()) {
      progress_.throwIfStopped();
      const uint32_t number = loaded->slab.block;
      if (!picker || part.block != number) {
        if (finish()) return goOn(part.end);
        sampling.emplace(samplingOf(blocks_[number]));
        const uint64_t begin = number == from.block ? from.cell : 0;
        part = {number, begin, sampling->endOfPart(begin, most)};
        const uint64_t count = sampling->pointsBefore(part.end) - sampling->pointsBefore(begin);
        if (points.size() + count > most) return goOn(begin);
        picker.emplace(blocks_[number], *sampling, part, points);
      }
      picker->add(*loaded);
    }
    return finish() ? goOn(part.end) : Place{end};
  }

  void locateInParts(std::span<const BlockPoint> points) {
    const uint64_t most = mostLocated(points.size());
    while (!points.empty()) {
      const size_t count = std::min<size_t>(points.size(), most);
      locate(points.first(count));
      points = points.subspan(count);
    }
  }

  /// Adds the volumes of the points that lie in other blocks.
  void locate(std::span<const BlockPoint> points) {
    PointHolders holders(points);
    std::vector<Slab> wanted;
    for (uint32_t block = 0; block < blocks_.size(); ++block)
      if (!bounds_[block].box.isEmpty() && holders.mayHold(block, bounds_[block].box))
        std::ranges::copy(slabsOf(block), std::back_inserter(wanted));
    const auto finish = [&](uint32_t block) {
      for (const uint32_t point : holders.finishBlock())
        shared_.add(points[point].block, block, points[point].volume);
    };
    SlabStream slabs(reader_, memory_.slab_bytes, std::move(wanted));
    std::optional<uint32_t> block;
    while (const LoadedSlab* loaded = slabs.next()) {
      progress_.throwIfStopped();
      const uint32_t number = loaded->slab.block;
      if (block && *block != number) {
        finish(*block);
        block.reset();
        if (holders.areAllFound()) break;
      }
      block = number;
      holders.locate(blocks_[number], *loaded, progress_);
    }
    if (block) finish(*block);
    met_in_vain_ += holders.metInVain();
  }

  const std::vector<GridBlock>& blocks_;
  const NodeReader reader_;
  const OverlapMemory memory_;
  const Progress& progress_;
  double cells_ = 0;
  uint64_t met_in_vain_ = 0;
  std::vector<Bounds> bounds_;      // [block]; slanted where the block is one slab
  std::vector<double> volumes_;     // [block], of those whose points have been picked
  std::optional<BoxTree> tree_;     // of the bounds
  std::vector<bool> meets_;         // [block], whether its box touches another
  std::vector<Slab> slabs_;         // of blocks with cells, block by block
  std::vector<size_t> first_slab_;  // [block], and their end
  SharedVolumes shared_;
};

}  // namespace

std::vector<BlockOverlap> findOverlaps(const GridSource& source, const OverlapMemory& memory,
                                       const Progress& progress, uint64_t* met_in_vain) {
  if (met_in_vain) *met_in_vain = 0;
  const size_t blocks = source.description().blocks.size();
  if (blocks < 2 || blocks > kMaxBlocks) return {};
  OverlapSearch search(source, memory, progress);
  std::vector<BlockOverlap> overlaps = search.find();
  if (met_in_vain) *met_in_vain = search.metInVain();
  return overlaps;
}

namespace {

/// "in about 3.2 cubic units (block 1 and block 2: 3.2, 12 % of the smaller; ...)"
std::string wordsOf(const GridDescription& description, const std::vector<BlockOverlap>& overlaps) {
  std::vector<BlockOverlap> largest = overlaps;
  std::stable_sort(largest.begin(), largest.end(),
                   [](const BlockOverlap& a, const BlockOverlap& b) { return a.volume > b.volume; });
  double total = 0;
  for (const BlockOverlap& overlap : overlaps) total += overlap.volume;
  std::string pairs;
  for (size_t n = 0; n < std::min(kPairsNamed, largest.size()); ++n) {
    const double percent = 100 * largest[n].share;
    pairs += fmt::format("{}{} and {}: {:.3g}, {} % of the smaller", n ? "; " : "",
                         description.blocks[largest[n].first].name,
                         description.blocks[largest[n].second].name, largest[n].volume,
                         percent < 9.95 ? fmt::format("{:.2g}", percent) : fmt::format("{:.0f}", percent));
  }
  if (largest.size() > kPairsNamed) pairs += fmt::format("; and {} more pairs", largest.size() - kPairsNamed);
  return fmt::format("in about {:.3g} cubic units ({})", total, pairs);
}

}  // namespace

std::string unsearchedOverlaps(const GridDescription& description) {
  if (description.blocks.size() <= kMaxBlocks) return "";
  return fmt::format("not checked for overlaps between its {} blocks (limit {})", description.blocks.size(),
                     kMaxBlocks);
}

std::string overlapWarning(const GridDescription& description, const std::vector<BlockOverlap>& overlaps) {
  if (overlaps.empty()) return "";
  return fmt::format("blocks overlap {} and are all drawn there", wordsOf(description, overlaps));
}

std::string overlapNote(const GridDescription& description, const std::vector<BlockOverlap>& overlaps) {
  if (overlaps.empty()) return "";
  return fmt::format(
      "blocks overlap {}; each point is drawn once, by the block that has the smallest cells there "
      "(--overlap all draws every block)",
      wordsOf(description, overlaps));
}

}  // namespace curvisplat
