#include "preprocess/survey/block_overlap.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <glm/common.hpp>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/hexahedron_location.h"
#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/box_tree.h"
#include "preprocess/survey/point_tree.h"
#include "stream/base/check.h"

namespace curvisplat {
namespace {

constexpr double kPoints = 100'000;  // approximate number of points inside all blocks; more at their faces
constexpr size_t kMaxBlocks = 100'000;
constexpr uint64_t kBinsAlongAxis = 64;
// A smaller share of the smaller block is attributed to rounding, or to curved faces that two blocks
// approximate by different chords.
constexpr double kNegligibleShare = 2e-3;
constexpr size_t kPairsNamed = 4;
constexpr uint8_t kMaxHolders = 16;  // of a point: other blocks that are found to hold it

/// A sample point of a block, and the volume that it represents.
struct BlockPoint {
  glm::dvec3 position{0.0};
  double volume = 0;
  uint32_t block = 0;
};

/// A sample point in a cell along one axis: its position (0 to 1), and the number of cells it represents.
struct AxisPoint {
  double t, cells;
};

/// The sample points along an axis of `cells` cells, by cell: several in the first and the last cell, close
/// to the ends of the block, to find overlaps of less than a cell; `wanted` at the centres of other cells,
/// evenly spread.
std::map<uint64_t, std::vector<AxisPoint>> pointsAlong(uint64_t cells, uint64_t wanted, bool few) {
  const std::vector<AxisPoint> end = few ? std::vector<AxisPoint>{{0.1, 0.2}, {0.6, 0.8}}
                                         : std::vector<AxisPoint>{{0.05, 0.1}, {0.2, 0.2}, {0.65, 0.7}};
  std::map<uint64_t, std::vector<AxisPoint>> points;
  if (cells == 1) {
    for (const AxisPoint& point : end) {
      points[0].push_back({point.t / 2, point.cells / 2});
      points[0].push_back({1 - point.t / 2, point.cells / 2});
    }
    return points;
  }
  points[0] = end;
  for (const AxisPoint& point : end) points[cells - 1].push_back({1 - point.t, point.cells});
  const uint64_t inner = cells - 2, count = std::min(inner, std::max<uint64_t>(1, wanted));
  for (uint64_t n = 0; n < count; ++n)
    points[1 + (2 * n + 1) * inner / (2 * count)] = {
        {0.5, static_cast<double>(inner) / static_cast<double>(count)}};
  return points;
}

/// The sample points of a block, as a product of those along each axis.
struct Sampling {
  std::map<uint64_t, std::vector<AxisPoint>> i, j, k;

  Sampling(const GridBlock& block, double cells_in_all, size_t blocks) {
    const auto cells = static_cast<double>((block.ni - 1) * (block.nj - 1) * (block.nk - 1));
    // One of every `step` cells along each axis.
    const double step = std::max(1.0, std::cbrt(cells_in_all / kPoints));
    const auto wanted = [&](uint64_t nodes) {
      return static_cast<uint64_t>(static_cast<double>(nodes - 1) / step);
    };
    const bool few = blocks > 200;
    CURVISPLAT_CHECK(cells > 0);
    i = pointsAlong(block.ni - 1, wanted(block.ni), few);
    j = pointsAlong(block.nj - 1, wanted(block.nj), few);
    k = pointsAlong(block.nk - 1, wanted(block.nk), few);
  }
};

glm::dvec3 pointIn(const std::array<glm::dvec3, 8>& corner, double u, double v, double w) {
  const auto along_i = [&](size_t c) { return glm::mix(corner[c], corner[c + 1], u); };
  return glm::mix(glm::mix(along_i(0), along_i(2), v), glm::mix(along_i(4), along_i(6), v), w);
}

/// Whether the trilinear hexahedron contains the point. Its faces belong to none.
bool holds(const std::array<glm::dvec3, 8>& corner, const glm::dvec3& point) {
  const std::optional<glm::dvec3> u = locateInHexahedron(corner, point);
  return u && std::abs(u->x) < 1 && std::abs(u->y) < 1 && std::abs(u->z) < 1;
}

/// Some of `points`, given by number, sorted into the cells of a uniform lattice. Borrows the points.
class Bins {
 public:
  Bins(const std::vector<BlockPoint>& points, const std::vector<uint32_t>& numbers) {
    for (const uint32_t n : numbers) box_.add(points[n].position);
    for (int axis = 0; axis < 3; ++axis) {
      const double extent = box_.upper[axis] - box_.lower[axis];
      scale_[axis] = extent > 0 ? static_cast<double>(kBinsAlongAxis) / extent : 0.0;
    }
    first_.assign(kBinsAlongAxis * kBinsAlongAxis * kBinsAlongAxis + 1, 0);
    for (const uint32_t n : numbers) ++first_[binOf(points[n].position) + 1];
    for (size_t bin = 1; bin < first_.size(); ++bin) first_[bin] += first_[bin - 1];
    std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
    sorted_.resize(numbers.size());
    for (const uint32_t n : numbers) sorted_[next[binOf(points[n].position)]++] = n;
  }

  /// Calls each(number) for the points of the bins that the box touches. False, and calls nothing, if there are many bins or points.
  template <typename Each>
  bool forEachOfFew(const BoundingBox& box, const Each& each) const {
    constexpr uint64_t kFewBins = 64, kFewPoints = 64;
    if (!box_.meets(box)) return true;
    const auto low = place(box.lower), high = place(box.upper);
    if ((high[0] - low[0] + 1) * (high[1] - low[1] + 1) * (high[2] - low[2] + 1) > kFewBins) return false;
    const auto for_each_row = [&](const auto& visit) {
      for (uint64_t z = low[2]; z <= high[2]; ++z)
        for (uint64_t y = low[1]; y <= high[1]; ++y) {
          const uint64_t row = (z * kBinsAlongAxis + y) * kBinsAlongAxis;
          visit(first_[row + low[0]], first_[row + high[0] + 1]);
        }
    };
    uint64_t count = 0;
    for_each_row([&](uint32_t begin, uint32_t end) { count += end - begin; });
    if (count > kFewPoints) return false;
    if (count == 0) return true;
    for_each_row([&](uint32_t begin, uint32_t end) {
      for (uint32_t n = begin; n < end; ++n) each(sorted_[n]);
    });
    return true;
  }

 private:
  std::array<uint64_t, 3> place(const glm::dvec3& position) const {
    std::array<uint64_t, 3> place;
    for (int axis = 0; axis < 3; ++axis) {
      const double at = (position[axis] - box_.lower[axis]) * scale_[axis];
      place[axis] = static_cast<uint64_t>(std::clamp(at, 0.0, static_cast<double>(kBinsAlongAxis - 1)));
    }
    return place;
  }
  uint64_t binOf(const glm::dvec3& position) const {
    const auto at = place(position);
    return (at[2] * kBinsAlongAxis + at[1]) * kBinsAlongAxis + at[0];
  }

  BoundingBox box_;
  glm::dvec3 scale_{0.0};
  std::vector<uint32_t> first_, sorted_;
};

/// Calls each(element of the lowest node, strides, i, j, k) for the cells of a slab that are not blanked, in
/// parallel by rows; skips rows for which `keep` is false.
template <typename Keep, typename Each>
void forEachCell(const GridBlock& block, const LoadedSlab& loaded, const Keep& keep, const Each& each) {
  const Slab& slab = loaded.slab;
  const WindowStrides strides(slab.window, block.ni);
  const uint64_t width = slab.box.j1 - slab.box.j0;
  tbb::parallel_for(uint64_t{0}, rowsOf(slab.box), [&](uint64_t n) {
    const uint64_t j = slab.box.j0 + n % width, k = slab.box.k0 + n / width;
    if (j + 1 >= block.nj || k + 1 >= block.nk || !keep(j, k)) return;
    size_t at = strides.at(slab.box.i0, j, k);
    for (uint64_t i = slab.box.i0; i < slab.box.i1 && i + 1 < block.ni; ++i, ++at)
      if (!cornerMarks(loaded.nodes.blank.data(), at, strides.row, strides.plane))
        each(at, strides.row, strides.plane, i, j, k);
  });
}

std::array<glm::dvec3, 8> cornersIn(const LoadedSlab& loaded, size_t at, size_t row, size_t plane) {
  return cornersAt(loaded.nodes.x.data(), loaded.nodes.y.data(), loaded.nodes.z.data(), at, row, plane);
}

struct BlockMeasure {
  BoundingBox box;
  double volume = 0;
};

/// The first pass: bounding boxes and volumes of the blocks, and their sample points.
std::vector<BlockPoint> pickPoints(const NodeReader& reader, uint64_t slab_bytes, const Progress& progress,
                                   std::vector<BlockMeasure>& measures) {
  const std::vector<GridBlock>& blocks = reader.source().description().blocks;
  double cells = 0;
  for (const GridBlock& block : blocks)
    cells += static_cast<double>((block.ni - 1) * (block.nj - 1) * (block.nk - 1));
  using Numbered = std::pair<std::pair<uint32_t, uint64_t>, std::vector<BlockPoint>>;  // of (block, cell)
  std::vector<Numbered> of_cells;
  SlabStream slabs(reader, slab_bytes, kCornerHalo);
  while (const LoadedSlab* loaded = slabs.next()) {
    progress.throwIfStopped();
    const uint32_t number = loaded->slab.block;
    const GridBlock& block = blocks[number];
    for (size_t n = 0; n < loaded->nodes.x.size(); ++n)
      if (!loaded->nodes.blank[n])
        measures[number].box.add({loaded->nodes.x[n], loaded->nodes.y[n], loaded->nodes.z[n]});
    if (block.ni < 2 || block.nj < 2 || block.nk < 2) continue;
    const Sampling sampling(block, cells, blocks.size());
    tbb::enumerable_thread_specific<std::vector<Numbered>> found;
    forEachCell(
        block, *loaded,
        [&](uint64_t j, uint64_t k) { return sampling.j.contains(j) && sampling.k.contains(k); },
        [&](size_t at, size_t row, size_t plane, uint64_t i, uint64_t j, uint64_t k) {
          const auto along_i = sampling.i.find(i);
          if (along_i == sampling.i.end()) return;
          const std::array<glm::dvec3, 8> corner = cornersIn(*loaded, at, row, plane);
          const double volume = std::abs(Hexahedron(corner).volume());
          std::vector<BlockPoint> points;
          for (const AxisPoint& w : sampling.k.at(k))
            for (const AxisPoint& v : sampling.j.at(j))
              for (const AxisPoint& u : along_i->second)
                points.push_back(
                    {pointIn(corner, u.t, v.t, w.t), volume * u.cells * v.cells * w.cells, number});
          found.local().push_back({{number, (k * block.nj + j) * block.ni + i}, std::move(points)});
        });
    for (const auto& of_thread : found) of_cells.insert(of_cells.end(), of_thread.begin(), of_thread.end());
  }
  std::sort(of_cells.begin(), of_cells.end(),
            [](const Numbered& a, const Numbered& b) { return a.first < b.first; });
  std::vector<BlockPoint> points;
  for (const auto& [cell, of_cell] : of_cells)
    for (const BlockPoint& point : of_cell) {
      points.push_back(point);
      measures[point.block].volume += point.volume;
    }
  return points;
}

/// Which points (by number) other blocks contain, as the blocks come one after another. A point that lies in
/// kMaxHolders blocks is located no further: otherwise a set that names one file a thousand times would take
/// the square of that.
class Holders {
 public:
  explicit Holders(const std::vector<BlockPoint>& points)
      : points_(points),
        counts_(points.size(), 0),
        latest_(points.size()),
        bins_(points, allOf(points)),
        tree_(treeOf(allOf(points))) {}

  bool areAllFound() const { return !is_pruned_ && tree_.size() == 0; }

  /// Locates the points in the cells of a slab. Throws Interrupted if a stop is asked for.
  void locate(const GridBlock& block, const LoadedSlab& loaded, const Progress& progress) {
    const Slab& slab = loaded.slab;
    const uint64_t width = slab.box.j1 - slab.box.j0;
    std::vector<uint64_t> next(rowsOf(slab.box), slab.box.i0);  // [row]: the first cell that is not searched
    tbb::enumerable_thread_specific<std::vector<uint32_t>> found;
    std::atomic<bool> complete = false;
    while (!complete && tree_.size() > 0) {
      complete = true;
      forEachCell(
          block, loaded,
          [&](uint64_t, uint64_t) {
            progress.throwIfStopped();
            return true;
          },
          [&](size_t at, size_t row, size_t plane, uint64_t i, uint64_t j, uint64_t k) {
            uint64_t& next_of_row = next[(k - slab.box.k0) * width + j - slab.box.j0];
            if (i < next_of_row) return;
            if (shouldPrune()) {
              complete = false;
              return;
            }
            next_of_row = i + 1;
            locateInCell(slab.block, cornersIn(loaded, at, row, plane), found.local());
          });
      if (!complete) prune(slab.block);
    }
    for (const auto& of_thread : found)
      for (const uint32_t point : of_thread) {
        inside_.push_back({point, slab.block});
        if (++counts_[point] == kMaxHolders) ++finished_;
      }
  }

  /// To be called after the last slab of each block.
  void finishBlock() {
    met_in_vain_ += in_vain_.exchange(0);
    if (!is_pruned_ && 2 * finished_ <= tree_.size()) return;
    std::vector<uint32_t> wanted;
    for (uint32_t point = 0; point < points_.size(); ++point)
      if (counts_[point] < kMaxHolders) wanted.push_back(point);
    sort(wanted);
    finished_ = 0;
    is_pruned_ = false;
  }

  /// How often cells met points that were not to be located in them, in the blocks that are finished.
  uint64_t metInVain() const { return met_in_vain_; }

  /// (point, block), sorted.
  std::vector<std::pair<uint32_t, uint32_t>> take() {
    std::sort(inside_.begin(), inside_.end());
    return std::move(inside_);
  }

 private:
  // Where cells pass through one another, such as those of random coordinates, each of them meets a share of
  // all points, nearly all of which are the block's own or were found in its first cells. So many meetings cost
  // what sorting the points again does: for each of them, and in any case.
  static constexpr size_t kInVainEach = 32, kInVainAnyway = 1 << 17;

  /// Adds those to `found` that the cell holds. Any thread.
  void locateInCell(uint32_t block, const std::array<glm::dvec3, 8>& corner, std::vector<uint32_t>& found) {
    BoundingBox box;
    for (const glm::dvec3& node : corner) box.add(node);
    size_t in_vain = 0;
    const auto locate = [&](uint32_t point) {
      if (!isWanted(point, block)) {
        ++in_vain;
      } else if (holds(corner, points_[point].position) && note(point, block)) {
        found.push_back(point);
      }
    };
    const auto locate_in_box = [&](uint32_t point) {
      if (box.holds(points_[point].position)) locate(point);
    };
    if (!bins_.forEachOfFew(box, locate_in_box)) tree_.forEachNear(corner, locate);
    if (in_vain > 0) in_vain_.fetch_add(in_vain, std::memory_order_relaxed);
  }
  /// Whether the point is to be located in the cells of `block`. Any thread.
  bool isWanted(uint32_t point, uint32_t block) const {
    return points_[point].block != block && counts_[point] < kMaxHolders &&
           latest_[point].load(std::memory_order_relaxed) != block + 1;
  }
  /// `block` contains the point. Returns whether that is new: two cells may both contain a point of their common face. Any thread.
  bool note(uint32_t point, uint32_t block) {
    return latest_[point].exchange(block + 1, std::memory_order_relaxed) != block + 1;
  }

  /// Any thread.
  bool shouldPrune() const {
    return in_vain_.load(std::memory_order_relaxed) > kInVainEach * tree_.size() + kInVainAnyway;
  }
  /// Sorts again the points that are still to be located in `block`. finishBlock() brings back the others.
  void prune(uint32_t block) {
    std::vector<uint32_t> wanted;
    tree_.forEach([&](uint32_t point) {
      if (isWanted(point, block)) wanted.push_back(point);
    });
    sort(wanted);
    met_in_vain_ += in_vain_.exchange(0);
    is_pruned_ = true;
  }
  void sort(const std::vector<uint32_t>& wanted) {
    bins_ = Bins(points_, wanted);
    tree_ = treeOf(wanted);
  }

  static std::vector<uint32_t> allOf(const std::vector<BlockPoint>& points) {
    std::vector<uint32_t> numbers(points.size());
    std::iota(numbers.begin(), numbers.end(), 0u);
    return numbers;
  }
  PointTree treeOf(const std::vector<uint32_t>& numbers) const {
    return PointTree(std::span<const BlockPoint>(points_), numbers);
  }

  const std::vector<BlockPoint>& points_;
  std::vector<uint8_t> counts_;  // [point]
  std::vector<std::atomic<uint32_t>>
      latest_;                      // [point]: 1 + the latest block that is known to contain it; 0: none
  Bins bins_;                       // the points still to be located, and few others
  PointTree tree_;                  // the same: for cells in whose bins many lie
  size_t finished_ = 0;             // of the points in tree_
  bool is_pruned_ = false;          // tree_ lacks points that blocks to come are searched for
  std::atomic<size_t> in_vain_{0};  // how often cells met points that are not wanted, since tree_ was built
  uint64_t met_in_vain_ = 0;        // before that
  std::vector<std::pair<uint32_t, uint32_t>> inside_;
};

/// The second pass: pairs (point, other block that contains it), sorted.
std::vector<std::pair<uint32_t, uint32_t>> findInside(const NodeReader& reader, uint64_t slab_bytes,
                                                      const Progress& progress,
                                                      const std::vector<BlockPoint>& points,
                                                      uint64_t* met_in_vain) {
  const std::vector<GridBlock>& blocks = reader.source().description().blocks;
  Holders holders(points);
  uint32_t block = 0;
  SlabStream slabs(reader, slab_bytes, kCornerHalo);
  while (const LoadedSlab* loaded = slabs.next()) {
    progress.throwIfStopped();
    const uint32_t number = loaded->slab.block;
    if (number != std::exchange(block, number)) holders.finishBlock();
    if (holders.areAllFound()) break;
    holders.locate(blocks[number], *loaded, progress);
  }
  holders.finishBlock();
  if (met_in_vain) *met_in_vain = holders.metInVain();
  return holders.take();
}

}  // namespace

std::vector<BlockOverlap> findOverlaps(const GridSource& source, uint64_t slab_bytes,
                                       const Progress& progress, uint64_t* met_in_vain) {
  if (met_in_vain) *met_in_vain = 0;
  const size_t blocks = source.description().blocks.size();
  std::vector<BlockOverlap> overlaps;
  if (blocks < 2 || blocks > kMaxBlocks) return overlaps;
  const NodeReader reader(source, {}, std::nullopt);
  std::vector<BlockMeasure> measures(blocks);
  std::vector<BlockPoint> points = pickPoints(reader, slab_bytes, progress, measures);

  // Points outside all other blocks' bounding boxes need no search.
  std::vector<BoundingBox> boxes;
  for (const BlockMeasure& measure : measures) boxes.push_back(measure.box);
  const BoxTree tree(boxes);
  std::erase_if(points, [&](const BlockPoint& point) {
    progress.throwIfStopped();
    return !tree.anotherHolds(point.position, point.block);
  });
  if (points.empty()) return overlaps;

  std::map<std::pair<uint32_t, uint32_t>, double> shared;  // (block of points, block of cells) -> volume
  for (const auto& [point, block] : findInside(reader, slab_bytes, progress, points, met_in_vain))
    shared[{points[point].block, block}] += points[point].volume;
  // The points of either block give an estimate for the pair; the larger one is used.
  std::map<std::pair<uint32_t, uint32_t>, double> of_pairs;
  for (const auto& [pair, volume] : shared) {
    double& largest = of_pairs[std::minmax(pair.first, pair.second)];
    largest = std::max(largest, volume);
  }
  for (const auto& [pair, volume] : of_pairs) {
    const double smaller = std::min(measures[pair.first].volume, measures[pair.second].volume);
    if (volume > kNegligibleShare * smaller)
      overlaps.push_back(
          {pair.first, pair.second, std::min(volume, smaller), std::min(1.0, volume / smaller)});
  }
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
