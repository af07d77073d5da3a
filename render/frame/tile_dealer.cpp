#include "render/frame/tile_dealer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

#include "render/frame/hidden_bricks.h"
#include "render/project/kernel.h"
#include "render/project/tile_set.h"

namespace curvisplat {
namespace {

// Nanoseconds by nanoseconds of one core, of a brick in memory (curvisplat bench): decoding and projecting a splat
// take 1, sorting and painting it 1.5; clearing and resolving a tile costs as much as painting 300 splats for each
// painter's tile of pixels.
constexpr double kPaintPerPrepare = 1.5;
constexpr double kTileCost = 300.0 * kSharedTileSide * kSharedTileSide / (kTileSide * kTileSide);
// Finding out who gets a splat, and copying it four times: 0.47 with two ranks on one machine, 0.62 with four
// (bench/README.md).
constexpr double kExchangePerPrepare = 0.5;

/// A part as the tiles see it, in units of tiles, within the picture.
struct TilePart {
  double x0, y0, x1, y1;
  double prepare;
  double paint, splats;  // of a tile

  static TilePart of(const PartCost& cost, ImageSize size) {
    const auto tiles = [](float pixel, int pixels) {
      return std::clamp<double>(pixel / kSharedTileSide, 0, TileSet::tilesAlong(pixels, kSharedTileSide));
    };
    const ScreenBox& box = cost.box;
    TilePart part{tiles(box.x0, size.width),
                  tiles(box.y0, size.height),
                  tiles(box.x1, size.width),
                  tiles(box.y1, size.height),
                  cost.prepare,
                  0,
                  0};
    // A box without bounds, around the eye: its splats are taken to lie in the picture.
    double tiles_of_box =
        (double{box.x1} - box.x0) * (double{box.y1} - box.y0) / (kSharedTileSide * kSharedTileSide);
    if (!std::isfinite(tiles_of_box)) tiles_of_box = (part.x1 - part.x0) * (part.y1 - part.y0);
    part.paint = cost.paint / tiles_of_box;
    part.splats = cost.splats / tiles_of_box;
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
  Dealer(std::span<const PartCost> costs, ImageSize size, const TileDealing& how)
      : how_(how),
        columns_(TileSet::tilesAlong(size.width, kSharedTileSide)),
        owners_(TileSet::tilesOf(size, kSharedTileSide), kNobody) {
    for (const PartCost& cost : costs)
      if (const TilePart part = TilePart::of(cost, size); part.isSeen()) parts_.push_back(part);
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
    if (ranks == 1) return give(box, first);
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
    if (place == 0) return give(box, first);
    TileBox low = box, high = box;
    if (vertical)
      low.y1 = high.y0 = box.y0 + place;
    else
      low.x1 = high.x0 = box.x0 + place;
    divide(low, first, share, touching(low, parts));
    divide(high, first + share, ranks - share, touching(high, parts));
  }

  void give(const TileBox& box, uint32_t rank) {
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
      if (how_.each_prepares) {
        enters[first] += part.prepare;
        leaves[last] += part.prepare;
      }
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

  const TileDealing how_;
  const int columns_;
  std::vector<TilePart> parts_;
  std::vector<uint32_t> owners_;
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
    costs.push_back({box, drawn, kPaintPerPrepare * drawn,
                     uint64_t{brick.geometry.length} + variables[part.part.brick].values.length, drawn,
                     reachOf(box, brick.splats, view)});
  }
  return costs;
}

std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, const TileDealing& how,
                                uint32_t ranks) {
  return Dealer(parts, size, how).deal(ranks);
}

std::vector<uint32_t> dealTiles(std::span<const PartCost> parts, ImageSize size, uint32_t ranks) {
  const TileBox all{0, 0, TileSet::tilesAlong(size.width, kSharedTileSide),
                    TileSet::tilesAlong(size.height, kSharedTileSide)};
  return dealTiles(parts, size, {all}, ranks);
}

size_t partsARound(uint32_t ranks) {
  return size_t{8} * ranks;
}

std::vector<uint32_t> dealParts(std::span<const PartCost> parts, uint32_t ranks) {
  std::vector<uint32_t> preparers(parts.size());
  using Load = std::pair<double, uint32_t>;  // and its rank
  std::priority_queue<Load, std::vector<Load>, std::greater<>> least;
  for (uint32_t rank = 0; rank < ranks; ++rank) least.push({0, rank});
  std::vector<uint32_t> round;
  for (size_t begin = 0; begin < parts.size(); begin += partsARound(ranks)) {
    round.resize(std::min(partsARound(ranks), parts.size() - begin));
    std::iota(round.begin(), round.end(), static_cast<uint32_t>(begin));
    std::stable_sort(round.begin(), round.end(),
                     [&](uint32_t a, uint32_t b) { return parts[a].prepare > parts[b].prepare; });
    for (const uint32_t part : round) {
      const Load load = least.top();
      least.pop();
      preparers[part] = load.second;
      least.push({load.first + parts[part].prepare, load.second});
    }
  }
  return preparers;
}

namespace {

/// Adds what a part's splats cost the painters of its tiles, and those of the tiles beside them.
void addPainting(const PartCost& cost, ImageSize size, const std::vector<uint32_t>& owners, uint32_t preparer,
                 std::vector<RankWork>& work) {
  const int columns = TileSet::tilesAlong(size.width, kSharedTileSide),
            rows = TileSet::tilesAlong(size.height, kSharedTileSide);
  const TilePart part = TilePart::of(cost, size);
  if (!part.isSeen()) return;
  const double reach = (cost.reach_px + TileSet::kMargin) / kSharedTileSide;  // in tiles
  const double exchange = work.size() > 1 ? kExchangePerPrepare : 0;
  const double paint = cost.paint / cost.splats + exchange;
  const auto add = [&](uint32_t rank, double splats) {
    work[rank].paint += paint * splats;
    work[rank].splats += splats;
    if (rank != preparer) work[rank].splats_received += splats;
  };
  for (int y = static_cast<int>(part.y0); y < part.y1; ++y)
    for (int x = static_cast<int>(part.x0); x < part.x1; ++x) {
      const uint32_t owner = owners[static_cast<size_t>(y * columns + x)];
      const double splats = part.splats * part.along(false, x, x + 1) * part.along(true, y, y + 1);
      add(owner, splats);
      for (const auto& [dx, dy] : {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
        uint32_t last = owner;
        for (int n = 1; n - 1 < reach; ++n) {
          const int column = x + n * dx, row = y + n * dy;
          if (column < 0 || column >= columns || row < 0 || row >= rows) break;
          const uint32_t other = owners[static_cast<size_t>(row * columns + column)];
          if (other != last) add(other, splats * std::min(1.0, reach - (n - 1)));
          last = other;
        }
      }
    }
}

}  // namespace

SharedWork workOfRanks(std::span<const PartCost> parts, ImageSize size, uint32_t ranks) {
  const std::vector<uint32_t> owners = dealTiles(parts, size, ranks), preparers = dealParts(parts, ranks);
  const int columns = TileSet::tilesAlong(size.width, kSharedTileSide),
            rows = TileSet::tilesAlong(size.height, kSharedTileSide);
  SharedWork work{std::vector<RankWork>(ranks), 0};
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      RankWork& owner = work.ranks[owners[static_cast<size_t>(y * columns + x)]];
      owner.paint += kTileCost;
      owner.pixels += static_cast<uint64_t>(std::min(kSharedTileSide, size.width - x * kSharedTileSide)) *
                      static_cast<uint64_t>(std::min(kSharedTileSide, size.height - y * kSharedTileSide));
    }
  std::vector<double> of_round(ranks);
  for (size_t n = 0; n < parts.size(); ++n) {
    RankWork& preparer = work.ranks[preparers[n]];
    preparer.prepare += parts[n].prepare;
    preparer.bytes += parts[n].bytes;
    ++preparer.bricks;
    of_round[preparers[n]] += parts[n].prepare;
    if ((n + 1) % partsARound(ranks) == 0 || n + 1 == parts.size()) {
      work.longest += *std::max_element(of_round.begin(), of_round.end());
      std::fill(of_round.begin(), of_round.end(), 0);
    }
    addPainting(parts[n], size, owners, preparers[n], work.ranks);
  }
  double longest_paint = 0;
  for (const RankWork& rank : work.ranks) longest_paint = std::max(longest_paint, rank.paint);
  work.longest += longest_paint;
  return work;
}

}  // namespace curvisplat
