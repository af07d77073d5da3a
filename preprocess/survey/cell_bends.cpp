#include "preprocess/survey/cell_bends.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <optional>
#include <queue>
#include <set>
#include <utility>

#include "preprocess/grid/node_reader.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/survey/joined_axes.h"
#include "preprocess/survey/stairs.h"

namespace curvisplat {
namespace {

constexpr uint64_t kWindowNodes = 1 << 18;  // a constant: what is sampled must not depend on memory

// The deviation of the optical depth, in %, for each unit of T, or of its square where cells grow.
constexpr double kGrowthWeight = 1.0, kBendWeight = 1.5, kTaperWeight = 2.5, kTwistWeight = 2.5;
constexpr double kMaxDeviation = 1.0;  // of a block that is not cut
// The same of small grids, where more splats cost nothing and borders add to what is measured, if all of the grid
// deviates by more: a few blocks that are cut alone make the cells at their joints uneven.
constexpr double kMaxDeviationOfSmall = 0.6;
constexpr uint64_t kSmallGrid = 100'000;  // nodes
// Small grids of several blocks have most nodes at borders and at joints with a kink, which are not measured: cells of
// blocks that deviate by more are halved along all axes.
constexpr double kMaxDeviationOfTiny = 0.3;
constexpr uint64_t kTinyGrid = 10'000;  // nodes
// Blocks of small grids of which a larger share lies at stairs (stairs.h) are halved along all axes as well.
constexpr double kMaxStairs = 0.02;
constexpr uint64_t kLargeGrid = 1'000'000;
// A picture of the whole grid shows bands of cells the less, the smaller they are: about deviation() where a cell's shortest edge
// is this part of the grid's diagonal. Fitted to what was drawn of nine grids (1.3 to 5.6 %), whole and cut: off by up to a factor
// of two to three, and too low for an O-grid of 79 blocks (2.5 for 19 %).
constexpr double kShownEdge = 0.0195;
constexpr double kShown = 2;  // % from which on cells are seen
// A large grid's survey takes a few percent of a conversion.
constexpr uint64_t kSampledNodes = 2'000'000;

/// The axes of a pair, in the order of BlockBends::squares.
std::array<size_t, 2> axesOf(size_t pair) {
  return pair < 3 ? std::array{pair, pair} : std::array{(pair + 1) % 3, (pair + 2) % 3};
}

double weightOf(size_t component, size_t pair) {
  if (pair < 3) return component == pair ? kGrowthWeight : kBendWeight;
  return component + 3 == pair ? kTwistWeight : kTaperWeight;
}

/// The part of a mean square that remains if cells are cut.
double remains(size_t component, size_t pair, const CellCuts& cuts) {
  const auto [a, b] = axesOf(pair);
  const double along = cuts[component], first = cuts[a], second = cuts[b];
  if (a != b) return along * along / (first * first * second * second);
  return component == a ? 1 / first : along * along / (first * first * first);
}

/// Sums over nodes, not yet divided by the volume.
BlockBends sum(BlockBends a, const BlockBends& b) {
  a.volume += b.volume;
  a.shortest += b.shortest;
  a.lower = glm::min(a.lower, b.lower);
  a.upper = glm::max(a.upper, b.upper);
  for (size_t c = 0; c < 3; ++c)
    for (size_t pair = 0; pair < 6; ++pair) a.squares[c][pair] += b.squares[c][pair];
  return a;
}

/// The nodes of a window around one of them.
class SecondDifferences {
 public:
  SecondDifferences(const NodeArrays& nodes, const WindowStrides& strides, const GridBlock& block)
      : nodes_(nodes), strides_{1, strides.row, strides.plane}, counts_{block.ni, block.nj, block.nk} {}

  /// Adds the node of the block at `index`, which is element `at`, unless a node around it is missing.
  void add(const std::array<uint64_t, 3>& index, size_t at, BlockBends& sums) const {
    std::array<ptrdiff_t, 3> before{}, after{};
    for (size_t axis = 0; axis < 3; ++axis) {
      if (index[axis] > 0) before[axis] = -static_cast<ptrdiff_t>(strides_[axis]);
      if (index[axis] + 1 < counts_[axis]) after[axis] = static_cast<ptrdiff_t>(strides_[axis]);
      // Beside the outer planes only where there are no others: they have one neighbour.
      if (counts_[axis] > 2 && (before[axis] == 0 || after[axis] == 0)) return;
    }
    for (const ptrdiff_t i : {before[0], ptrdiff_t{0}, after[0]})
      for (const ptrdiff_t j : {before[1], ptrdiff_t{0}, after[1]})
        for (const ptrdiff_t k : {before[2], ptrdiff_t{0}, after[2]})
          if (nodes_.blank[at + static_cast<size_t>(i + j + k)] != 0) return;
    const auto position = [&](ptrdiff_t step) {
      const size_t n = at + static_cast<size_t>(step);
      return glm::dvec3(nodes_.x[n], nodes_.y[n], nodes_.z[n]);
    };
    for (size_t a = 0; a < 3; ++a) {
      const size_t b = (a + 1) % 3;
      if (counts_[a] == 2 && counts_[b] == 2 && isWedge(position, before[a] + after[a], before[b] + after[b]))
        return;
    }
    const auto per = [&](size_t axis) { return before[axis] != 0 && after[axis] != 0 ? 0.5 : 1.0; };
    glm::dmat3 jacobian(0.0);
    std::array<glm::dvec3, 6> second{};
    for (size_t a = 0; a < 3; ++a) {
      const size_t b = (a + 1) % 3, c = (a + 2) % 3;
      jacobian[static_cast<int>(a)] = per(a) * (position(after[a]) - position(before[a]));
      if (before[a] != 0 && after[a] != 0)
        second[a] = position(after[a]) - 2.0 * position(0) + position(before[a]);
      second[3 + a] = per(b) * per(c) *
                      (position(after[b] + after[c]) - position(after[b] + before[c]) -
                       position(before[b] + after[c]) + position(before[b] + before[c]));
    }
    const double volume = std::abs(glm::determinant(jacobian));
    const double size = glm::length(jacobian[0]) * glm::length(jacobian[1]) * glm::length(jacobian[2]);
    if (!(volume > 1e-9 * size)) return;
    const glm::dmat3 inverse = glm::inverse(jacobian);
    sums.volume += volume;
    sums.shortest +=
        volume * std::min({glm::length(jacobian[0]), glm::length(jacobian[1]), glm::length(jacobian[2])});
    sums.lower = glm::min(sums.lower, position(0));
    sums.upper = glm::max(sums.upper, position(0));
    for (size_t pair = 0; pair < 6; ++pair) {
      const glm::dvec3 t = inverse * second[pair];
      for (size_t c = 0; c < 3; ++c) {
        const double part = std::min(std::abs(t[static_cast<int>(c)]), 1.0);
        const double weighted = weightOf(c, pair) * (c == pair ? part * part : part);
        sums.squares[c][pair] += volume * weighted * weighted;
      }
    }
  }

 private:
  /// Whether a column of cells, from the node along two axes, has cells with three corners: where three blocks meet.
  /// Their parts would be as pointed as they are.
  template <class Position>
  static bool isWedge(const Position& position, ptrdiff_t along, ptrdiff_t across) {
    const glm::dvec3 here = position(0), next = position(along), other = position(across);
    const glm::dvec3 opposite = position(along + across);
    return here == next || here == other || opposite == next || opposite == other;
  }

  const NodeArrays& nodes_;
  std::array<size_t, 3> strides_;
  std::array<uint64_t, 3> counts_;
};

BlockBends sumOf(const GridBlock& block, const LoadedSlab& loaded) {
  const Slab& slab = loaded.slab;
  const WindowStrides strides(slab.window, block.ni);
  const SecondDifferences differences(loaded.nodes, strides, block);
  const uint64_t width = slab.box.j1 - slab.box.j0, end = slab.box.endOfRow(block.ni);
  return tbb::parallel_deterministic_reduce(
      tbb::blocked_range<uint64_t>(0, rowsOf(slab.box), 16), BlockBends(),
      [&](const tbb::blocked_range<uint64_t>& rows, BlockBends sums) {
        for (uint64_t n = rows.begin(); n < rows.end(); ++n) {
          const uint64_t j = slab.box.j0 + n % width, k = slab.box.k0 + n / width;
          for (uint64_t i = slab.box.i0; i < end; ++i) differences.add({i, j, k}, strides.at(i, j, k), sums);
        }
        return sums;
      },
      sum);
}

/// The cells of a block, which bound the splats: blocks that meet have the splats of their common nodes once, so that cuts
/// multiply the splats of many small blocks by more than their nodes. A sheet counts as one cell thick, which is not cut.
uint64_t cellsOf(const GridBlock& block, const CellCuts& cuts = kWholeCells) {
  const auto along = [](uint64_t nodes, uint64_t parts) { return nodes > 1 ? (nodes - 1) * parts : 1; };
  return along(block.ni, cuts[0]) * along(block.nj, cuts[1]) * along(block.nk, cuts[2]);
}

uint64_t nodesOf(const std::vector<GridBlock>& blocks) {
  uint64_t nodes = 0;
  for (const GridBlock& block : blocks) nodes += block.nodes();
  return nodes;
}

/// Every nth slab of each block, with n = one_in, and at least one of each block.
std::vector<Slab> sampleOf(const std::vector<Slab>& slabs, uint64_t one_in) {
  std::vector<Slab> sample;
  for (size_t begin = 0, end = 0; begin < slabs.size(); begin = end) {
    while (end < slabs.size() && slabs[end].block == slabs[begin].block) ++end;
    const size_t of_block = end - begin, count = (of_block + one_in - 1) / one_in;
    for (size_t n = 0; n < count; ++n) sample.push_back(slabs[begin + (2 * n + 1) * of_block / (2 * count)]);
  }
  return sample;
}

double deviationOf(const std::vector<BlockBends>& bends) {
  double square = 0, volume = 0;
  for (const BlockBends& of_block : bends) {
    volume += of_block.volume;
    square += of_block.volume * of_block.deviation() * of_block.deviation();
  }
  return volume > 0 ? std::sqrt(square / volume) : 0;
}

/// Chooses cuts: of the block that shows most the axes that help most for their cells, and so on until no block
/// shows, or there would be too many cells.
class CutChoice {
 public:
  /// `classes`: joinedAxes() of the blocks. `max_deviation`: of blocks that are not cut.
  CutChoice(const std::vector<GridBlock>& blocks, const std::vector<BlockBends>& bends,
            std::vector<std::array<uint32_t, 3>> classes, double max_deviation)
      : blocks_(blocks),
        bends_(bends),
        classes_(std::move(classes)),
        max_deviation_(max_deviation),
        of_classes_(3 * blocks.size(), 1),
        blocks_of_(3 * blocks.size()) {
    for (uint32_t block = 0; block < blocks.size(); ++block)
      for (const uint32_t of_class : classes_[block]) {
        std::vector<uint32_t>& members = blocks_of_[of_class];
        if (members.empty() || members.back() != block) members.push_back(block);
      }
  }

  /// The cells of all blocks, as they are cut.
  uint64_t cells() const {
    uint64_t sum = 0;
    for (uint32_t block = 0; block < blocks_.size(); ++block) sum += cellsOf(blocks_[block], cutsOf(block));
    return sum;
  }

  /// Cuts cells along the axes that need it. `most`: cells.
  void cutByNeed(uint64_t most) {
    struct Waiting {
      double square;
      uint32_t block;
      bool operator<(const Waiting& other) const {
        return square != other.square ? square < other.square : block > other.block;
      }
    };
    std::priority_queue<Waiting> waiting;
    const auto wait = [&](uint32_t block) {
      if (bends_[block].deviation(cutsOf(block)) > max_deviation_)
        waiting.push({squareOf(block, cutsOf(block)), block});
    };
    for (uint32_t block = 0; block < blocks_.size(); ++block) wait(block);
    uint64_t all_cells = cells();
    while (!waiting.empty()) {
      const Waiting worst = waiting.top();
      waiting.pop();
      if (worst.square != squareOf(worst.block, cutsOf(worst.block))) {  // another block's cut has cut it
        wait(worst.block);
        continue;
      }
      const std::optional<Cut> best = bestCut(worst.block, most - all_cells);
      if (!best) continue;
      for (const uint32_t of_class : best->classes) of_classes_[of_class] *= 2;
      all_cells += best->cells;
      wait(worst.block);
    }
  }

  /// Halves the cells of some blocks along the axes that are not cut. `most`: cells.
  template <typename IsHalved>
  void halveWhole(const IsHalved& is_halved, uint64_t most) {
    for (uint32_t block = 0; block < blocks_.size(); ++block) {
      if (!is_halved(block)) continue;
      for (const uint32_t of_class : classes_[block]) {
        if (of_classes_[of_class] > 1) continue;
        of_classes_[of_class] = 2;
        if (cells() > most) of_classes_[of_class] = 1;
      }
    }
  }

  Refinement chosen() const {
    std::vector<CellCuts> of_blocks;
    for (uint32_t block = 0; block < blocks_.size(); ++block) of_blocks.push_back(cutsOf(block));
    return Refinement(std::move(of_blocks));
  }

 private:
  static constexpr uint32_t kMaxParts = 8;
  static constexpr double kMinGain = 0.1;  // of the squares of the blocks that are cut

  struct Cut {
    std::vector<uint32_t> classes;  // each once
    uint64_t cells = 0;             // that it adds
    double gain = 0;                // for each of them
  };

  CellCuts cutsOf(uint32_t block) const {
    const std::array<uint32_t, 3>& classes = classes_[block];
    return {of_classes_[classes[0]], of_classes_[classes[1]], of_classes_[classes[2]]};
  }
  double squareOf(uint32_t block, const CellCuts& cuts) const {
    const double deviation = bends_[block].deviation(cuts);
    return bends_[block].volume * deviation * deviation;
  }

  /// The best way to cut the cells of a block along some axes into twice as many parts, and those of the blocks
  /// that go on with it.
  std::optional<Cut> bestCut(uint32_t block, uint64_t room) const {
    std::optional<Cut> best;
    for (unsigned axes = 1; axes < 8; ++axes) {
      std::set<uint32_t> classes;
      for (size_t axis = 0; axis < 3; ++axis)
        if ((axes >> axis & 1) != 0) classes.insert(classes_[block][axis]);
      const std::optional<Cut> cut = cutOf({classes.begin(), classes.end()});
      if (cut && cut->cells <= room && (!best || cut->gain > best->gain)) best = cut;
    }
    return best;
  }

  std::optional<Cut> cutOf(const std::vector<uint32_t>& classes) const {
    Cut cut{classes};
    double before = 0, after = 0;
    std::set<uint32_t> blocks;
    for (const uint32_t of_class : classes) {
      if (of_classes_[of_class] >= kMaxParts) return {};
      blocks.insert(blocks_of_[of_class].begin(), blocks_of_[of_class].end());
    }
    for (const uint32_t block : blocks) {
      const CellCuts whole = cutsOf(block);
      CellCuts cuts = whole;
      for (size_t axis = 0; axis < 3; ++axis)
        if (std::find(classes.begin(), classes.end(), classes_[block][axis]) != classes.end())
          cuts[axis] *= 2;
      before += squareOf(block, whole);
      after += squareOf(block, cuts);
      cut.cells += cellsOf(blocks_[block], cuts) - cellsOf(blocks_[block], whole);
    }
    if (cut.cells == 0 || !(before - after > kMinGain * before)) return {};
    cut.gain = (before - after) / static_cast<double>(cut.cells);
    return cut;
  }

  const std::vector<GridBlock>& blocks_;
  const std::vector<BlockBends>& bends_;
  const std::vector<std::array<uint32_t, 3>> classes_;
  const double max_deviation_;
  std::vector<uint32_t> of_classes_;              // [class] its parts
  std::vector<std::vector<uint32_t>> blocks_of_;  // [class]
};

}  // namespace

double BlockBends::deviation(const CellCuts& cuts) const {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c)
    for (size_t pair = 0; pair < 6; ++pair) sum += squares[c][pair] * remains(c, pair, cuts);
  return std::sqrt(sum);
}

std::vector<BlockBends> measureBends(const GridSource& source, uint64_t nodes) {
  const std::vector<GridBlock>& blocks = source.description().blocks;
  std::vector<BlockBends> bends(blocks.size());
  const uint64_t one_in = std::max<uint64_t>((nodesOf(blocks) + nodes - 1) / nodes, 1);
  const NodeReader reader(source, {}, std::nullopt);
  SlabStream stream(reader, kWindowNodes * slabBytesPerNode(0),
                    sampleOf(cutIntoSlabs(blocks, kWindowNodes, kNodeHalo), one_in));
  while (const LoadedSlab* loaded = stream.next()) {
    BlockBends& of_block = bends[loaded->slab.block];
    of_block = sum(of_block, sumOf(blocks[loaded->slab.block], *loaded));
  }
  for (BlockBends& of_block : bends)
    if (of_block.volume > 0) {
      of_block.shortest /= of_block.volume;
      for (auto& of_component : of_block.squares)
        for (double& square : of_component) square /= of_block.volume;
    }
  return bends;
}

Refinement refinementByNeed(const GridSource& source, const std::vector<uint32_t>& scalars,
                            std::optional<double> blank_value) {
  const std::vector<GridBlock>& blocks = source.description().blocks;
  const uint64_t nodes = nodesOf(blocks);
  if (nodes > kMaxCutByNeed) return {};
  const std::vector<BlockBends> bends = measureBends(source, kSampledNodes);
  const double deviation = deviationOf(bends);
  const bool small = nodes <= kSmallGrid && deviation > kMaxDeviationOfSmall;
  const bool tiny = nodes <= kTinyGrid && blocks.size() > 1 && deviation > kMaxDeviationOfTiny;
  const double max = small ? kMaxDeviationOfSmall : kMaxDeviation;
  const bool shows =
      std::ranges::any_of(bends, [max](const BlockBends& of_block) { return of_block.deviation() > max; });
  const std::vector<double> stairs =
      nodes <= kSmallGrid ? shareAtStairs(source, scalars, blank_value) : std::vector<double>(blocks.size());
  const std::vector<double> kinks =
      nodes <= kTinyGrid ? deviationAtKinks(source) : std::vector<double>(blocks.size());
  const auto is_halved = [&](uint32_t block) {
    return (tiny && bends[block].deviation() > kMaxDeviationOfTiny) || stairs[block] > kMaxStairs ||
           kinks[block] > kMaxDeviationOfSmall;
  };
  bool halves = false;
  for (uint32_t block = 0; block < blocks.size(); ++block) halves |= is_halved(block);
  if (!shows && !halves) return {};
  CutChoice choice(blocks, bends, joinedAxes(source), max);
  const uint64_t cells = choice.cells();  // not cut yet
  const uint64_t most = nodes > kLargeGrid ? cells + cells / 2 : 8 * cells;
  choice.cutByNeed(most);
  choice.halveWhole(is_halved, most);
  return choice.chosen();
}

std::string noteOnCells(const GridSource& source, bool by_need) {
  constexpr double kMinShare = 0.05;  // of the volume
  const std::vector<GridBlock>& blocks = source.description().blocks;
  const uint64_t nodes = nodesOf(blocks);
  if (nodes > kMaxCutByNeed) return {};
  const std::vector<BlockBends> bends = measureBends(source, kSampledNodes);
  const std::vector<double> kinks =
      nodes <= kLargeGrid ? deviationAtKinks(source) : std::vector<double>(blocks.size());
  BlockBends all;
  for (const BlockBends& of_block : bends) all = sum(all, of_block);
  const double edge = kShownEdge * glm::distance(all.lower, all.upper);
  double square = 0, volume = 0, shown = 0;
  size_t count = 0;
  for (size_t block = 0; block < blocks.size(); ++block) {
    volume += bends[block].volume;
    const double bend = bends[block].deviation();
    const double of_bends =
        bend > kMaxDeviation ? bend * bends[block].shortest / edge : 0;  // else cut enough, or even
    const double deviation = std::hypot(of_bends, kinks[block]);
    if (!(deviation > kShown)) continue;
    ++count;
    shown += bends[block].volume;
    square += bends[block].volume * deviation * deviation;
  }
  if (count == 0 || shown < kMinShare * volume) return {};
  return fmt::format(
      "cells{} differ much from those beside them: a picture will show bands of about "
      "{:.0f} % of the optical depth; {}",
      count < blocks.size() ? fmt::format(" of {} of {} blocks", count, blocks.size()) : "",
      std::sqrt(square / shown),
      source.description().refinement.cutsCells() ? "--refine N with a larger N makes them smaller"
      : by_need                                   ? "--refine N cuts all of them"
                                                  : "--refine auto cuts them where it helps, --refine N all");
}

}  // namespace curvisplat
