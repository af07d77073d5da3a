#include "render/ranks/tile_dealer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "render/project/footprint.h"
#include "render/sweep/hidden_bricks.h"

namespace curvisplat {
namespace {

/// Costs of a box cut at every place along one axis: [n] of what lies before tile n, and of what lies from it on.
struct CutCosts {
  std::vector<double> before, behind;
};

class Dealer {
 public:
  Dealer(std::span<const PartCost> costs, ImageSize size, const TileDealing& how)
      : how_(how),
        columns_(TileSet::tilesAlong(size.width, kSharedTileSide)),
        owners_(TileSet::tilesOf(size, kSharedTileSide), kNobody) {
    for (const PartCost& cost : costs)
      if (const TilePart part = TilePart::of(cost, size); part.isSeen()) parts_.push_back(part);
  }

  /// Deals by the costs of tiles instead of parts.
  Dealer(std::span<const double> tile_costs, ImageSize size)
      : how_{{0, 0, TileSet::tilesAlong(size.width, kSharedTileSide),
              TileSet::tilesAlong(size.height, kSharedTileSide)}},
        columns_(how_.box.x1),
        owners_(tile_costs.size(), kNobody),
        sums_((static_cast<size_t>(columns_) + 1) * (static_cast<size_t>(how_.box.y1) + 1)) {
    for (int y = 0; y < how_.box.y1; ++y) {
      double row = 0;
      for (int x = 0; x < columns_; ++x) {
        row += tile_costs[static_cast<size_t>(y * columns_ + x)];
        sums_[placeOf(x + 1, y + 1)] = sums_[placeOf(x + 1, y)] + row;
      }
    }
  }

  std::vector<uint32_t> deal(uint32_t ranks) {
    std::vector<uint32_t> parts(parts_.size());
    for (uint32_t n = 0; n < parts.size(); ++n) parts[n] = n;
    divide(how_.box, 0, ranks, touching(how_.box, parts));
    return std::move(owners_);
  }

 private:
  /// Gives the tiles of a box to the ranks first .. first + ranks - 1. `parts`: those that touch it.
  void divide(const TileBox& box, uint32_t first, uint32_t ranks, const std::vector<uint32_t>& parts) {
    if (ranks == 1) return assign(box, first);
    bool vertical = false;
    int place = 0;
    uint32_t share = 1;
    double best = std::numeric_limits<double>::infinity();
    for (const bool along_y : {box.rows() > box.columns(), box.rows() <= box.columns()}) {
      const CutCosts costs = cutCosts(box, along_y, parts);
      const int tiles = along_y ? box.rows() : box.columns();
      const int begin = along_y ? box.y0 : box.x0;
      for (int n = how_.unit - begin % how_.unit; n < tiles; n += how_.unit) {
        const double before = costs.before[static_cast<size_t>(n)],
                     behind = costs.behind[static_cast<size_t>(n)];
        const double exact = ranks * before / (before + behind);
        for (const double rounded : {std::floor(exact), std::ceil(exact)}) {
          const double left = std::clamp<double>(rounded, 1, ranks - 1);
          const double largest = std::max(before / left, behind / (ranks - left));
          if (!(largest < best)) continue;
          best = largest;
          vertical = along_y;
          place = n;
          share = static_cast<uint32_t>(left);
        }
      }
    }
    if (place == 0) return assign(box, first);
    TileBox low = box, high = box;
    if (vertical)
      low.y1 = high.y0 = box.y0 + place;
    else
      low.x1 = high.x0 = box.x0 + place;
    divide(low, first, share, touching(low, parts));
    divide(high, first + share, ranks - share, touching(high, parts));
  }

  void assign(const TileBox& box, uint32_t rank) {
    for (int y = box.y0; y < box.y1; ++y)
      for (int x = box.x0; x < box.x1; ++x) owners_[static_cast<size_t>(y * columns_ + x)] = rank;
  }

  std::vector<uint32_t> touching(const TileBox& box, const std::vector<uint32_t>& parts) const {
    std::vector<uint32_t> found;
    for (const uint32_t n : parts)
      if (parts_[n].along(false, box.x0, box.x1) > 0 && parts_[n].along(true, box.y0, box.y1) > 0)
        found.push_back(n);
    return found;
  }

  size_t placeOf(int x, int y) const { return static_cast<size_t>(y * (columns_ + 1) + x); }

  double costOf(const TileBox& box) const {
    return sums_[placeOf(box.x1, box.y1)] - sums_[placeOf(box.x0, box.y1)] - sums_[placeOf(box.x1, box.y0)] +
           sums_[placeOf(box.x0, box.y0)];
  }

  CutCosts cutCosts(const TileBox& box, bool vertical) const {
    CutCosts costs;
    TileBox low = box, high = box;
    int& place = vertical ? low.y1 : low.x1;
    for (place = vertical ? box.y0 : box.x0; place <= (vertical ? box.y1 : box.x1); ++place) {
      (vertical ? high.y0 : high.x0) = place;
      costs.before.push_back(costOf(low));
      costs.behind.push_back(costOf(high));
    }
    return costs;
  }

  CutCosts cutCosts(const TileBox& box, bool vertical, const std::vector<uint32_t>& parts) const {
    if (!sums_.empty()) return cutCosts(box, vertical);
    const int begin = vertical ? box.y0 : box.x0, end = vertical ? box.y1 : box.x1;
    const auto tiles = static_cast<size_t>(end - begin);
    std::vector<double> paint(tiles, kTileCost * (vertical ? box.columns() : box.rows()));
    std::vector<double> enters(tiles), leaves(tiles);
    for (const uint32_t number : parts) {
      const TilePart& part = parts_[number];
      const double from = std::max<double>(begin, vertical ? part.y0 : part.x0);
      const double to = std::min<double>(end, vertical ? part.y1 : part.x1);
      const double across = vertical ? part.along(false, box.x0, box.x1) : part.along(true, box.y0, box.y1);
      const auto first = static_cast<size_t>(from) - static_cast<size_t>(begin);
      const size_t last = static_cast<size_t>(std::ceil(to)) - static_cast<size_t>(begin) - 1;
      if (how_.each_prepares) {
        enters[first] += part.prepare;
        leaves[last] += part.prepare;
      }
      for (size_t n = first; n <= last; ++n) {
        const double tile = static_cast<double>(begin) + static_cast<double>(n);
        paint[n] += (part.paint + part.sort) * across * part.along(vertical, tile, tile + 1);
      }
    }
    CutCosts costs{std::vector<double>(tiles + 1), std::vector<double>(tiles + 1)};
    for (size_t n = 0; n < tiles; ++n) costs.before[n + 1] = costs.before[n] + paint[n] + enters[n];
    for (size_t n = tiles; n-- > 0;) costs.behind[n] = costs.behind[n + 1] + paint[n] + leaves[n];
    return costs;
  }

  const TileDealing how_;
  const int columns_;
  std::vector<TilePart> parts_;
  std::vector<uint32_t> owners_;
  std::vector<double> sums_;  // of the costs of tiles above and to the left, where those are known
};

/// About half the width of a footprint, if its splats fill the box evenly.
double reachOf(const ScreenBox& box, double splats, const ScreenView& view) {
  constexpr double kLargest = 64;
  const double side = std::sqrt((double{box.x1} - box.x0) * (double{box.y1} - box.y0)) / std::cbrt(splats);
  if (!std::isfinite(side)) return kLargest;
  return std::min(kLargest, kKernelSupport * std::sqrt(0.25 * side * side + view.low_pass_px2));
}

}  // namespace

std::vector<PartCost> partCosts(std::span<const SweptPart> parts, std::span<const Brick> bricks,
                                std::span<const BrickVariable> variables, const ScreenView& view) {
  std::vector<PartCost> costs;
  costs.reserve(parts.size());
  for (const SweptPart& part : parts) {
    const Brick& brick = bricks[part.part.brick];
    const auto drawn = static_cast<double>(SplatRanges(brick, part.part.octants).splats());
    const ScreenBox box = screenBoxOf(brick, view);
    const double reach = reachOf(box, brick.splats, view);
    costs.push_back({box, drawn, kPaintPerPixel * reach * reach * drawn,
                     uint64_t{brick.geometry.length} + variables[part.part.brick].values.length, drawn, reach,
                     kSortPerPrepare * drawn});
  }
  return costs;
}

std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, const TileDealing& how,
                                uint32_t ranks) {
  return Dealer(parts, size, how).deal(ranks);
}

std::vector<uint32_t> dealTiles(std::span<const double> tile_costs, ImageSize size, uint32_t ranks) {
  return Dealer(tile_costs, size).deal(ranks);
}

std::vector<double> tileCosts(std::span<const PartCost> parts, ImageSize size) {
  const int columns = TileSet::tilesAlong(size.width, kSharedTileSide);
  std::vector<double> costs(TileSet::tilesOf(size, kSharedTileSide), kTileCost);
  for (const PartCost& cost : parts) {
    const TilePart part = TilePart::of(cost, size);
    if (!part.isSeen()) continue;
    for (int y = static_cast<int>(part.y0); y < part.y1; ++y)
      for (int x = static_cast<int>(part.x0); x < part.x1; ++x)
        costs[static_cast<size_t>(y * columns + x)] +=
            (part.paint + part.sort) * part.along(false, x, x + 1) * part.along(true, y, y + 1);
  }
  return costs;
}

}  // namespace curvisplat
