#include "render/frame/tile_dealer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/frame/hidden_bricks.h"
#include "render/project/tile_set.h"

namespace curvisplat {
namespace {

// Nanoseconds by nanoseconds of one core, of a brick in memory (curvisplat bench): decoding and projecting a splat
// take 1, sorting and painting it 1.5; clearing and resolving a tile costs as much as painting 300 splats.
constexpr double kPaintPerPrepare = 1.5;
constexpr double kTileCost = 300;

/// A part as the tiles see it, in units of tiles, within the picture.
struct TilePart {
  double x0, y0, x1, y1;
  double prepare, paint;  // paint: of a tile

  static TilePart of(const PartCost& cost, ImageSize size) {
    const auto tiles = [](float pixel, int pixels) {
      return std::clamp<double>(pixel / kTileSide, 0, TileSet::tilesAlong(pixels));
    };
    const ScreenBox& box = cost.box;
    TilePart part{tiles(box.x0, size.width),
                  tiles(box.y0, size.height),
                  tiles(box.x1, size.width),
                  tiles(box.y1, size.height),
                  cost.prepare,
                  0};
    // A box without bounds, around the eye: its splats are taken to lie in the picture.
    const double whole = (double{box.x1} - box.x0) * (double{box.y1} - box.y0) / (kTileSide * kTileSide);
    part.paint = cost.paint / (std::isfinite(whole) ? whole : (part.x1 - part.x0) * (part.y1 - part.y0));
    return part;
  }
  bool isSeen() const { return x0 < x1 && y0 < y1; }

  double along(bool vertical, double from, double to) const {
    return std::max(0.0, std::min(to, vertical ? y1 : x1) - std::max(from, vertical ? y0 : x0));
  }
};

/// Costs of a box cut at every place along one axis: [n] of what lies before tile n, and of what lies from it on.
struct CutCosts {
  std::vector<double> before, behind;
};

class Dealer {
 public:
  Dealer(std::span<const PartCost> costs, ImageSize size)
      : columns_(TileSet::tilesAlong(size.width)), owners_(TileSet::tilesOf(size), kNobody) {
    for (const PartCost& cost : costs)
      if (const TilePart part = TilePart::of(cost, size); part.isSeen()) parts_.push_back(part);
  }

  std::vector<uint32_t> deal(const TileBox& box, uint32_t ranks) {
    std::vector<uint32_t> parts(parts_.size());
    for (uint32_t n = 0; n < parts.size(); ++n) parts[n] = n;
    divide(box, 0, ranks, touching(box, parts));
    return std::move(owners_);
  }

 private:
  /// Gives the tiles of a box to the ranks first .. first + ranks - 1. `parts`: those that touch it.
  void divide(const TileBox& box, uint32_t first, uint32_t ranks, const std::vector<uint32_t>& parts) {
    if (ranks == 1 || box.tiles() <= 1) {
      for (int y = box.y0; y < box.y1; ++y)
        for (int x = box.x0; x < box.x1; ++x) owners_[static_cast<size_t>(y * columns_ + x)] = first;
      return;
    }
    bool vertical = false;
    int place = 0;
    uint32_t share = 1;
    double best = std::numeric_limits<double>::infinity();
    for (const bool along_y : {box.rows() > box.columns(), box.rows() <= box.columns()}) {
      const CutCosts costs = cutCosts(box, along_y, parts);
      const int tiles = along_y ? box.rows() : box.columns();
      for (int n = 1; n < tiles; ++n) {
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
    TileBox low = box, high = box;
    if (vertical)
      low.y1 = high.y0 = box.y0 + place;
    else
      low.x1 = high.x0 = box.x0 + place;
    divide(low, first, share, touching(low, parts));
    divide(high, first + share, ranks - share, touching(high, parts));
  }

  std::vector<uint32_t> touching(const TileBox& box, const std::vector<uint32_t>& parts) const {
    std::vector<uint32_t> found;
    for (const uint32_t n : parts)
      if (parts_[n].along(false, box.x0, box.x1) > 0 && parts_[n].along(true, box.y0, box.y1) > 0)
        found.push_back(n);
    return found;
  }

  CutCosts cutCosts(const TileBox& box, bool vertical, const std::vector<uint32_t>& parts) const {
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
      enters[first] += part.prepare;
      leaves[last] += part.prepare;
      for (size_t n = first; n <= last; ++n) {
        const double tile = static_cast<double>(begin) + static_cast<double>(n);
        paint[n] += part.paint * across * part.along(vertical, tile, tile + 1);
      }
    }
    CutCosts costs{std::vector<double>(tiles + 1), std::vector<double>(tiles + 1)};
    for (size_t n = 0; n < tiles; ++n) costs.before[n + 1] = costs.before[n] + paint[n] + enters[n];
    for (size_t n = tiles; n-- > 0;) costs.behind[n] = costs.behind[n + 1] + paint[n] + leaves[n];
    return costs;
  }

  const int columns_;
  std::vector<TilePart> parts_;
  std::vector<uint32_t> owners_;
};

}  // namespace

std::vector<PartCost> partCosts(std::span<const SweptPart> parts, std::span<const Brick> bricks,
                                std::span<const BrickVariable> variables, const ScreenView& view) {
  std::vector<PartCost> costs;
  costs.reserve(parts.size());
  for (const SweptPart& part : parts) {
    const Brick& brick = bricks[part.part.brick];
    const auto drawn = static_cast<double>(SplatRanges(brick, part.part.octants).splats());
    costs.push_back({screenBoxOf(brick, view), drawn, kPaintPerPrepare * drawn,
                     uint64_t{brick.geometry.length} + variables[part.part.brick].values.length});
  }
  return costs;
}

std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, const TileBox& box,
                                uint32_t ranks) {
  return Dealer(parts, size).deal(box, ranks);
}

std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, uint32_t ranks) {
  return dealTiles(parts, size, {0, 0, TileSet::tilesAlong(size.width), TileSet::tilesAlong(size.height)},
                   ranks);
}

std::vector<RankWork> workOfRanks(std::span<const PartCost> parts, ImageSize size,
                                  const std::vector<uint32_t>& owners, uint32_t ranks) {
  const int columns = TileSet::tilesAlong(size.width), rows = TileSet::tilesAlong(size.height);
  std::vector<RankWork> work(ranks);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      RankWork& owner = work[owners[static_cast<size_t>(y * columns + x)]];
      owner.cost += kTileCost;
      owner.pixels += static_cast<uint64_t>(std::min(kTileSide, size.width - x * kTileSide)) *
                      static_cast<uint64_t>(std::min(kTileSide, size.height - y * kTileSide));
    }
  std::vector<size_t> counted(ranks);  // the last part that each rank was given, from 1
  for (size_t n = 0; n < parts.size(); ++n) {
    const TilePart part = TilePart::of(parts[n], size);
    if (!part.isSeen()) continue;
    for (int y = static_cast<int>(part.y0); y < part.y1; ++y)
      for (int x = static_cast<int>(part.x0); x < part.x1; ++x) {
        const uint32_t rank = owners[static_cast<size_t>(y * columns + x)];
        work[rank].cost += part.paint * part.along(false, x, x + 1) * part.along(true, y, y + 1);
        if (counted[rank] == n + 1) continue;
        counted[rank] = n + 1;
        work[rank].cost += parts[n].prepare;
        work[rank].bytes += parts[n].bytes;
        ++work[rank].bricks;
      }
  }
  return work;
}

}  // namespace curvisplat
