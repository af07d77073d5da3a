#include "preprocess/grid/grid_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "preprocess/grid/box_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxCount = std::numeric_limits<uint64_t>::max();

uint64_t productOf(uint64_t a, uint64_t b, const GridBlock& block, const CellCuts& parts) {
  if (b != 0 && a > kMaxCount / b)
    throw Error("block {} has {}x{}x{} nodes, too many to be refined {} times", block.name, block.ni,
                block.nj, block.nk, textOf(parts));
  return a * b;
}

GridBlock refinedBlock(const GridBlock& block, const CellCuts& parts) {
  GridBlock out = block;
  const std::array<uint64_t*, 3> counts{&out.ni, &out.nj, &out.nk};
  for (size_t axis = 0; axis < 3; ++axis)
    if (*counts[axis] > 1) *counts[axis] = productOf(*counts[axis] - 1, parts[axis], block, parts) + 1;
  productOf(productOf(out.ni, out.nj, block, parts), out.nk, block, parts);
  return out;
}

/// The planes of the grid around the refined ones from begin to end: with those before and behind a plane of the grid
/// itself, since the cells on both of its sides decide whether a node is blanked; for the values of cells with those of two
/// cells before, and of two cells and the node behind them after.
std::pair<uint64_t, uint64_t> planesAround(uint64_t begin, uint64_t end, uint64_t count, uint32_t parts,
                                           bool for_cells) {
  if (for_cells) return {std::max<uint64_t>(begin / parts, 2) - 2, std::min((end - 1) / parts + 4, count)};
  return {(std::max<uint64_t>(begin, 1) - 1) / parts, std::min((end - 1) / parts + 2, count)};
}

/// A cell and one beside it: the difference of their values, away from the cell, and the change within the cell that this is,
/// since the cells may differ in length.
struct CellStep {
  double difference = 0, change = 0;
};

/// How much a cell's value changes from its one side to the other, by the steps to the cells before and after it: along their
/// axis no part of the cell is then beyond these two (the monotonized central limiter of van Leer 1977).
double changeBetween(const CellStep& before, const CellStep& after) {
  if (!(before.difference * after.difference < 0)) return 0;
  const double most = 2 * std::min(std::abs(before.difference), std::abs(after.difference));
  return std::copysign(std::min(0.5 * std::abs(after.change - before.change), most), after.difference);
}

/// How much the value of a cell at a border changes, by the step away from the border and the further difference, to the second
/// cell: not at all unless both have one sign.
double changeAtBorder(const CellStep& step, double further) {
  if (!(step.difference * further > 0)) return 0;
  return std::copysign(std::min(std::abs(step.change), 2 * std::abs(further)), step.difference);
}

/// Interpolation by the parts of a cell: exact where both ends are equal, and the same from either end.
class PartsBetween {
 public:
  explicit PartsBetween(uint32_t parts) : parts_(parts) {
    for (uint32_t part = 0; part <= parts; ++part) shares_.push_back(static_cast<double>(part) / parts);
  }

  double operator()(double first, double last, uint32_t part) const {
    return first <= last ? first + shares_[part] * (last - first)
                         : last + shares_[parts_ - part] * (first - last);
  }

 private:
  uint32_t parts_;
  std::vector<double> shares_;
};

/// A refined node between nodes of the grid, in arrays of a box of these.
struct PlaceBetween {
  size_t at = 0;                    // of the lowest of them
  size_t axes = 0;                  // along which it lies between two
  std::array<size_t, 3> steps{};    // [n of these axes] from the lower to the higher one
  std::array<uint32_t, 3> parts{};  // [n of these axes] from the lower one
  std::array<size_t, 3> along{};    // [n of these axes] its number: 0 for i, 1 for j, 2 for k

  /// The number of nodes around it: 1, 2, 4 or 8.
  size_t corners() const { return size_t{1} << axes; }
  size_t corner(size_t number) const {
    size_t node = at;
    for (size_t axis = 0; axis < axes; ++axis) node += (number >> axis & 1) * steps[axis];
    return node;
  }
};

/// A face's nodes are the mean of both orders of its axes: another block may have them the other way round.
template <typename Value>
double valueBetween(const Value* values, const PlaceBetween& place,
                    const std::array<PartsBetween, 3>& between) {
  const std::array<size_t, 3>& step = place.steps;
  const auto part_of = [&](double first, double last, size_t axis) {
    return between[place.along[axis]](first, last, place.parts[axis]);
  };
  const auto line = [&](size_t at, size_t axis) {
    return part_of(values[at], values[at + step[axis]], axis);
  };
  const auto face = [&](size_t at) {
    return 0.5 *
           (part_of(line(at, 0), line(at + step[1], 0), 1) + part_of(line(at, 1), line(at + step[0], 1), 0));
  };
  if (place.axes == 1) return line(place.at, 0);
  if (place.axes == 2) return face(place.at);
  return part_of(face(place.at), face(place.at + step[2]), 2);
}

/// The nodes of the grid around a box of refined ones, and the way from the refined indices into their arrays.
class NodesAround {
 public:
  NodesAround(const GridBlock& grid, const GridBlock& refined, const NodeBox& box, const CellCuts& parts,
              bool for_cells)
      : parts_{parts[0], parts[1], parts[2]} {
    std::tie(box_.i0, box_.i1) = planesAround(box.i0, box.endOfRow(refined.ni), grid.ni, parts[0], for_cells);
    std::tie(box_.j0, box_.j1) = planesAround(box.j0, box.j1, grid.nj, parts[1], for_cells);
    std::tie(box_.k0, box_.k1) = planesAround(box.k0, box.k1, grid.nk, parts[2], for_cells);
    first_ = {box_.i0, box_.j0, box_.k0};
    counts_ = {box_.i1 - box_.i0, box_.j1 - box_.j0, box_.k1 - box_.k0};
    strides_ = {1, counts_[0], counts_[0] * counts_[1]};
  }

  const NodeBox& box() const { return box_; }

  PlaceBetween placeOf(const std::array<uint64_t, 3>& node) const {
    PlaceBetween place;
    for (size_t axis = 0; axis < 3; ++axis) {
      place.at += (node[axis] / parts_[axis] - first_[axis]) * strides_[axis];
      const auto part = static_cast<uint32_t>(node[axis] % parts_[axis]);
      if (part == 0) continue;
      place.steps[place.axes] = strides_[axis];
      place.along[place.axes] = axis;
      place.parts[place.axes++] = part;
    }
    return place;
  }

  /// [lowest node] whether a node of the cell is missing; a flat block's cells have no thickness.
  std::vector<uint8_t> brokenCells(std::vector<uint8_t> missing) const {
    for (size_t axis = 0; axis < 3; ++axis) {
      if (counts_[axis] < 2) continue;
      for (size_t n = 0; n < missing.size(); ++n) {
        const bool is_last = n / strides_[axis] % counts_[axis] + 1 == counts_[axis];
        missing[n] |= is_last ? 1 : missing[n + strides_[axis]];
      }
    }
    return missing;
  }

  /// The value of the part of a cell whose lowest node is the refined `node`. A cell's value is that of its middle, and the mean
  /// of its parts, none of which is beyond the cell and those that it shares faces with: a cell with the largest value of these
  /// does not change. `isThere(cell)`: whether a cell has a value, by its lowest node.
  template <typename IsThere>
  float valueOfPart(const NodeArrays& grid, const std::vector<float>& values,
                    const std::array<uint64_t, 3>& node, const IsThere& isThere) const {
    std::array<size_t, 3> planes{};
    size_t at = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      planes[axis] = node[axis] / parts_[axis] - first_[axis];
      at += planes[axis] * strides_[axis];
    }
    if (!isThere(at)) return values[at];
    const double value = values[at];
    double least = value, most = value;
    const auto include = [&](size_t cell) {
      if (!isThere(cell)) return;
      least = std::min<double>(least, values[cell]);
      most = std::max<double>(most, values[cell]);
    };
    double sum = 0, farthest = 0;  // what a part differs by, at most
    for (size_t axis = 0; axis < 3; ++axis) {
      if (planes[axis] > 0) include(at - strides_[axis]);
      if (planes[axis] + 2 < counts_[axis]) include(at + strides_[axis]);
      if (parts_[axis] == 1) continue;
      const auto parts = static_cast<double>(parts_[axis]);
      const double share = (static_cast<double>(2 * (node[axis] % parts_[axis]) + 1) - parts) / (2 * parts);
      const double change = changeAlong(axis, grid, values, {at, planes[axis]}, isThere);
      sum += share * change;
      farthest += 0.5 * std::abs(change) * (parts - 1) / parts;
    }
    // Changes along several axes add up, and those of a border lead away from the cells beside it.
    const double room = std::min(value - least, most - value);
    if (farthest > room) sum *= room / farthest;
    return static_cast<float>(value + sum);
  }

  /// Whether one of the cells that a refined node lies in, or on the border of, is whole.
  bool isInWhole(const std::array<uint64_t, 3>& node, const std::vector<uint8_t>& broken) const {
    size_t at = 0;
    std::array<size_t, 3> back{};  // to the cell before, along axes where the node is on its border
    for (size_t axis = 0; axis < 3; ++axis) {
      const uint64_t plane = node[axis] / parts_[axis] - first_[axis];
      at += plane * strides_[axis];
      if (node[axis] % parts_[axis] == 0 && plane > 0) back[axis] = strides_[axis];
    }
    for (const size_t i : {size_t{0}, back[0]})
      for (const size_t j : {size_t{0}, back[1]})
        for (const size_t k : {size_t{0}, back[2]})
          if (!broken[at - i - j - k]) return true;
    return false;
  }

 private:
  /// How much the value of the cell changes along an axis, from its one side to the other. `cell`: its lowest node and the
  /// plane of that across the axis.
  template <typename IsThere>
  double changeAlong(size_t axis, const NodeArrays& grid, const std::vector<float>& values,
                     const std::pair<size_t, size_t>& cell, const IsThere& isThere) const {
    const auto [at, plane] = cell;
    const size_t stride = strides_[axis], count = counts_[axis];
    if (plane + 1 >= count) return 0;
    const bool before = plane > 0 && isThere(at - stride);
    const bool after = plane + 2 < count && isThere(at + stride);
    if (before && after)
      return changeBetween(stepTo(at - stride, at, stride, grid, values),
                           stepTo(at + stride, at, stride, grid, values));
    if (after && isThere(at + 2 * stride))
      return changeAtBorder(stepTo(at + stride, at, stride, grid, values),
                            double{values[at + 2 * stride]} - values[at + stride]);
    if (before && plane > 1 && isThere(at - 2 * stride))
      return -changeAtBorder(stepTo(at - stride, at, stride, grid, values),
                             double{values[at - 2 * stride]} - values[at - stride]);
    return 0;
  }

  static CellStep stepTo(size_t other, size_t cell, size_t stride, const NodeArrays& grid,
                         const std::vector<float>& values) {
    // The edges at the lowest nodes stand for the cells: what counts is how they grow.
    const auto length = [&](size_t node) {
      return std::hypot(grid.x[node + stride] - grid.x[node], grid.y[node + stride] - grid.y[node],
                        grid.z[node + stride] - grid.z[node]);
    };
    const double difference = double{values[other]} - values[cell];
    const double own = length(cell), both = own + length(other);
    return {difference, own > 0 && both > own ? difference * 2 * own / both : difference};
  }

  std::array<uint64_t, 3> parts_;
  NodeBox box_;
  std::array<uint64_t, 3> first_{}, counts_{}, strides_{};
};

/// Calls `take` with the indices of each node of the box.
template <typename Take>
void forEachNode(const NodeBox& box, uint64_t ni, const Take& take) {
  for (uint64_t k = box.k0; k < box.k1; ++k)
    for (uint64_t j = box.j0; j < box.j1; ++j)
      for (uint64_t i = box.i0; i < box.endOfRow(ni); ++i) take(std::array{i, j, k});
}

class RefinedSource final : public ForwardingGrid {
 public:
  RefinedSource(std::unique_ptr<GridSource> source, const Refinement& refinement,
                std::optional<double> blank_value)
      : ForwardingGrid(std::move(source)) {
    if (blank_value) blank_value_ = static_cast<float>(*blank_value);
    for (uint32_t block = 0; block < description_.blocks.size(); ++block) {
      const CellCuts& parts = parts_.emplace_back(refinement.ofBlock(block));
      between_.push_back({PartsBetween(parts[0]), PartsBetween(parts[1]), PartsBetween(parts[2])});
      description_.blocks[block] = refinedBlock(description_.blocks[block], parts);
      least_along_rows_ = std::min(least_along_rows_, parts[0]);
    }
    for (GridBoundary& boundary : description_.boundaries)
      for (size_t axis = 0; axis < 3; ++axis) {
        boundary.first[axis] *= parts_.at(boundary.block)[axis];
        boundary.last[axis] *= parts_.at(boundary.block)[axis];
      }
    description_.refinement = refinement;
    description_.format += refinement.isUniform() ? fmt::format(", refined {}", textOf(refinement.ofBlock(0)))
                                                  : ", refined by need";
  }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    const size_t count = box.rowNodes(description_.blocks[block].ni) * (box.j1 - box.j0) * (box.k1 - box.k0);
    for (auto* const axis : {&out.x, &out.y, &out.z}) axis->resize(count);
    out.scalars.resize(scalars.size());
    for (std::vector<float>& values : out.scalars) values.resize(count);
    out.blank.clear();
    out.blank.reserve(count);
    const uint64_t planes = planesAtATime(block, box);
    for (NodeBox part = box; part.k0 < box.k1; part.k0 = part.k1) {
      part.k1 = std::min(part.k0 + planes, box.k1);
      readNext(block, part, scalars, out);
    }
  }

  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override {
    // The grid's rows are shorter.
    return (source().rowsInMemory(scalars) + least_along_rows_ - 1) / least_along_rows_;
  }

  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    const NodesAround around = aroundOf(block, box, false);
    std::vector<uint8_t> grid;
    if (!source().readFringePart(block, around.box(), grid)) return false;
    out.clear();
    forEachNode(box, description_.blocks[block].ni, [&](const std::array<uint64_t, 3>& node) {
      const PlaceBetween place = around.placeOf(node);
      bool all = true;
      for (size_t corner = 0; corner < place.corners(); ++corner)
        all = all && grid[place.corner(corner)] != 0;
      out.push_back(all);
    });
    return true;
  }

 private:
  NodesAround aroundOf(uint32_t block, const NodeBox& box, bool for_cells) const {
    return {source().description().blocks.at(block), description_.blocks.at(block), box, parts_[block],
            for_cells};
  }

  /// How many planes of a box are read at a time, since the grid's nodes around them are in memory besides.
  uint64_t planesAtATime(uint32_t block, const NodeBox& box) const {
    constexpr uint64_t kNodes = 1 << 17;  // of the grid
    const NodeBox around = aroundOf(block, box, true).box();
    const uint64_t of_plane = (around.i1 - around.i0) * (around.j1 - around.j0);
    const uint64_t planes =
        std::max<uint64_t>(kNodes / of_plane, 7) - 6;  // six are read for the next planes, too
    return planes * parts_[block][2];
  }

  /// Reads the nodes of a box to where the arrays of `out` are not filled yet, which is where out.blank ends.
  void readNext(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                NodeArrays& out) const {
    const bool has_cells =
        std::any_of(scalars.begin(), scalars.end(), [&](uint32_t n) { return isOfCells(n); });
    const NodesAround around = aroundOf(block, box, has_cells);
    NodeArrays grid;
    ForwardingGrid::read(block, around.box(), scalars, grid);
    const std::array<PartsBetween, 3>& between = between_[block];
    const uint64_t ni = description_.blocks[block].ni;
    const std::vector<uint8_t> broken = brokenCells(around, missingOf(scalars, grid));
    size_t at = out.blank.size();
    forEachNode(box, ni, [&](const std::array<uint64_t, 3>& node) {
      const PlaceBetween place = around.placeOf(node);
      out.x[at] = valueAt(grid.x, place, between);
      out.y[at] = valueAt(grid.y, place, between);
      out.z[at] = valueAt(grid.z, place, between);
      for (size_t n = 0; n < scalars.size(); ++n)
        out.scalars[n][at] =
            isOfCells(scalars[n])
                ? around.valueOfPart(grid, grid.scalars[n], node,
                                     [&](size_t cell) { return isThere(grid.scalars[n], cell, broken); })
                : valueAt(grid.scalars[n], place, between);
      ++at;
    });
    fillBlanks(around, box, ni, broken, grid.blank, out.blank);
  }

  /// Whether a cell has a value; `cell` is its lowest node.
  bool isThere(const std::vector<float>& values, size_t cell, const std::vector<uint8_t>& broken) const {
    return std::isfinite(values[cell]) && values[cell] != blank_value_ && (broken.empty() || !broken[cell]);
  }

  bool isOfCells(uint32_t scalar) const {
    return description_.scalars.at(scalar).centring == Centring::kCell;
  }

  /// The grid's own nodes keep their bits.
  template <typename Value>
  static Value valueAt(const std::vector<Value>& values, const PlaceBetween& place,
                       const std::array<PartsBetween, 3>& between) {
    if (place.axes == 0) return values[place.at];
    return static_cast<Value>(valueBetween(values.data(), place, between));
  }

  /// [node of the grid]: whether it is not there.
  std::vector<uint8_t> missingOf(std::span<const uint32_t> scalars, const NodeArrays& grid) const {
    std::vector<uint8_t> missing(grid.blank.size());
    for (size_t n = 0; n < missing.size(); ++n)
      missing[n] = grid.blank[n] != 0 ||
                   !(std::isfinite(grid.x[n]) && std::isfinite(grid.y[n]) && std::isfinite(grid.z[n]));
    for (size_t scalar = 0; scalar < scalars.size(); ++scalar) {
      if (isOfCells(scalars[scalar])) continue;
      const std::vector<float>& values = grid.scalars[scalar];
      for (size_t n = 0; n < missing.size(); ++n)
        missing[n] |= !std::isfinite(values[n]) || values[n] == blank_value_;
    }
    return missing;
  }

  /// NodesAround::brokenCells(), but empty if no node is missing.
  static std::vector<uint8_t> brokenCells(const NodesAround& around, std::vector<uint8_t> missing) {
    if (std::find(missing.begin(), missing.end(), 1) == missing.end()) return {};
    return around.brokenCells(std::move(missing));
  }

  static void fillBlanks(const NodesAround& around, const NodeBox& box, uint64_t ni,
                         const std::vector<uint8_t>& broken, const std::vector<uint8_t>& blank,
                         std::vector<uint8_t>& out) {
    if (broken.empty()) {
      out.resize(out.size() + box.rowNodes(ni) * (box.j1 - box.j0) * (box.k1 - box.k0));
      return;
    }
    forEachNode(box, ni, [&](const std::array<uint64_t, 3>& node) {
      const PlaceBetween place = around.placeOf(node);
      out.push_back(place.axes == 0 ? blank[place.at] : !around.isInWhole(node, broken));
    });
  }

  std::vector<CellCuts> parts_;                       // [block]
  std::vector<std::array<PartsBetween, 3>> between_;  // [block][axis]
  uint32_t least_along_rows_ = std::numeric_limits<uint32_t>::max();
  std::optional<float> blank_value_;
};

}  // namespace

std::unique_ptr<GridSource> refined(std::unique_ptr<GridSource> source, const Refinement& refinement,
                                    std::optional<double> blank_value) {
  CURVISPLAT_CHECK(refinement.isUniform() ||
                   refinement.ofBlocks().size() == source->description().blocks.size());
  CURVISPLAT_CHECK(!source->description().refinement.cutsCells());
  if (!refinement.cutsCells()) return source;
  return std::make_unique<RefinedSource>(std::move(source), refinement, blank_value);
}

}  // namespace curvisplat
