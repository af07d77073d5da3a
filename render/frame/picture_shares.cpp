#include "render/frame/picture_shares.h"

#include <algorithm>
#include <numeric>
#include <queue>
#include <utility>

#include "render/frame/tile_part.h"

namespace curvisplat {
namespace {

// Of a splat, where preparing it takes 1: finding out who gets it and copying it for others; taking it from another's message,
// or from this rank's own parts.
constexpr double kSendCost = 0.25, kReceiveCost = 0.25, kKeepCost = 0.1;

/// Splats of a part that a rank paints.
struct Painted {
  uint32_t rank;
  double splats;
};

/// Who paints how many splats of each part. Splats near the border of a rank's tiles are painted by its neighbour, too.
class PaintedParts {
 public:
  PaintedParts(std::span<const PartCost> parts, ImageSize size, const std::vector<uint32_t>& owners,
               uint32_t ranks)
      : columns_(TileSet::tilesAlong(size.width, kSharedTileSide)),
        rows_(TileSet::tilesAlong(size.height, kSharedTileSide)),
        owners_(owners),
        of_part_(ranks) {
    for (const PartCost& part : parts) {
      addPart(part, size);
      for (const uint32_t rank : ranks_of_part_) {
        painted_.push_back({rank, of_part_[rank]});
        of_part_[rank] = 0;
      }
      ranks_of_part_.clear();
      ends_.push_back(painted_.size());
    }
  }

  /// The ranks that paint any of a part's splats.
  std::span<const Painted> of(size_t part) const {
    const size_t begin = part == 0 ? 0 : ends_[part - 1];
    return std::span(painted_).subspan(begin, ends_[part] - begin);
  }

 private:
  void add(uint32_t rank, double splats) {
    if (!(splats > 0)) return;
    if (of_part_[rank] == 0) ranks_of_part_.push_back(rank);
    of_part_[rank] += splats;
  }

  uint32_t ownerOf(int column, int row) const {
    return owners_[static_cast<size_t>(row * columns_ + column)];
  }

  void addPart(const PartCost& cost, ImageSize size) {
    const TilePart part = TilePart::of(cost, size);
    if (!part.isSeen()) return;
    const double reach = (cost.reach_px + TileSet::kMargin) / kSharedTileSide;  // in tiles
    for (int y = static_cast<int>(part.y0); y < part.y1; ++y)
      for (int x = static_cast<int>(part.x0); x < part.x1; ++x) {
        const uint32_t owner = ownerOf(x, y);
        const double splats = part.splats * part.along(false, x, x + 1) * part.along(true, y, y + 1);
        add(owner, splats);
        for (const auto& [dx, dy] : {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
          uint32_t last = owner;
          for (int n = 1; n - 1 < reach; ++n) {
            const int column = x + n * dx, row = y + n * dy;
            if (column < 0 || column >= columns_ || row < 0 || row >= rows_) break;
            const uint32_t other = ownerOf(column, row);
            if (other != last) add(other, splats * std::min(1.0, reach - (n - 1)));
            last = other;
          }
        }
      }
  }

  const int columns_, rows_;
  const std::vector<uint32_t>& owners_;
  std::vector<Painted> painted_;  // of one part after the other
  std::vector<size_t> ends_;      // [part] in them
  std::vector<double> of_part_;   // [rank]
  std::vector<uint32_t> ranks_of_part_;
};

double paintCost(const PartCost& part) {
  return part.splats > 0 ? part.paint / part.splats : 0;
}

/// What each rank's tiles cost it before any splat is painted.
std::vector<RankWork> workOfTiles(ImageSize size, const std::vector<uint32_t>& owners, uint32_t ranks) {
  std::vector<RankWork> work(ranks);
  const int columns = TileSet::tilesAlong(size.width, kSharedTileSide),
            rows = TileSet::tilesAlong(size.height, kSharedTileSide);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      RankWork& owner = work[owners[static_cast<size_t>(y * columns + x)]];
      owner.paint += kTileCost;
      owner.pixels += static_cast<uint64_t>(std::min(kSharedTileSide, size.width - x * kSharedTileSide)) *
                      static_cast<uint64_t>(std::min(kSharedTileSide, size.height - y * kSharedTileSide));
    }
  return work;
}

/// [rank] what it should prepare, so that all have the same sum of both: sum, less what they paint, but at least 0. In the first
/// of the rounds nobody has anything to paint yet: there all have the same share.
std::vector<double> quotasOf(const std::vector<double>& paint, double prepare, double rounds) {
  std::vector<double> sorted = paint;
  std::sort(sorted.begin(), sorted.end());
  double sum = 0, level = 0;  // of the first ones, filled up to the same level
  for (size_t n = 0; n < sorted.size(); ++n) {
    sum += sorted[n];
    level = (sum + prepare) / static_cast<double>(n + 1);
    if (n + 1 == sorted.size() || level <= sorted[n + 1]) break;
  }
  std::vector<double> quotas;
  const double even = prepare / (rounds * static_cast<double>(paint.size()));
  for (const double of_rank : paint)
    quotas.push_back(even + (1 - 1 / rounds) * std::max(0.0, level - of_rank));
  return quotas;
}

/// [part] the rank that prepares it.   paint [rank]
std::vector<uint32_t> dealParts(std::span<const PartCost> parts, const PaintedParts& painted,
                                const std::vector<double>& paint) {
  const auto ranks = static_cast<uint32_t>(paint.size());
  double total = 0, dealt = 0;
  for (const PartCost& part : parts) total += part.prepare;
  const double rounds = static_cast<double>(parts.size()) / static_cast<double>(partsARound(ranks));
  const std::vector<double> quotas = quotasOf(paint, total, std::max(1.0, rounds));
  std::vector<double> loads(ranks);
  std::vector<uint32_t> preparers(parts.size()), round;
  struct Space {
    double left, load;  // load: when it was entered; what has changed since is entered anew
    uint32_t rank;
    bool operator<(const Space& other) const {
      return std::pair(left, other.rank) < std::pair(other.left, rank);
    }
  };
  for (size_t begin = 0; begin < parts.size(); begin += partsARound(ranks)) {
    round.resize(std::min(partsARound(ranks), parts.size() - begin));
    std::iota(round.begin(), round.end(), static_cast<uint32_t>(begin));
    for (const uint32_t part : round) dealt += parts[part].prepare;
    const double share = total > 0 ? dealt / total : 0;
    std::stable_sort(round.begin(), round.end(),
                     [&](uint32_t a, uint32_t b) { return parts[a].prepare > parts[b].prepare; });
    std::priority_queue<Space> spaces;
    const auto enter = [&](uint32_t rank) {
      spaces.push({quotas[rank] * share - loads[rank], loads[rank], rank});
    };
    for (uint32_t rank = 0; rank < ranks; ++rank) enter(rank);
    for (const uint32_t part : round) {
      const double prepare = parts[part].prepare;
      const Painted* most = nullptr;
      for (const Painted& one : painted.of(part))
        if (loads[one.rank] + 0.5 * prepare <= quotas[one.rank] * share &&
            (!most || one.splats > most->splats))
          most = &one;
      while (spaces.top().load != loads[spaces.top().rank]) spaces.pop();
      const uint32_t rank = most ? most->rank : spaces.top().rank;
      preparers[part] = rank;
      loads[rank] += prepare;
      enter(rank);
    }
  }
  return preparers;
}

/// [rank] what painting takes it.
std::vector<double> paintOf(std::span<const PartCost> parts, const PaintedParts& painted,
                            const std::vector<RankWork>& tiles) {
  std::vector<double> paint;
  for (const RankWork& rank : tiles) paint.push_back(rank.paint);
  for (size_t n = 0; n < parts.size(); ++n)
    for (const Painted& one : painted.of(n))
      paint[one.rank] += (paintCost(parts[n]) + kReceiveCost) * one.splats;
  return paint;
}

}  // namespace

size_t partsARound(uint32_t ranks) {
  return size_t{8} * ranks;
}

PictureShares sharePicture(std::span<const PartCost> parts, ImageSize size, uint32_t ranks) {
  PictureShares shares{dealTiles(parts, size, ranks), {}};
  const PaintedParts painted(parts, size, shares.owners, ranks);
  shares.preparers =
      dealParts(parts, painted, paintOf(parts, painted, workOfTiles(size, shares.owners, ranks)));
  return shares;
}

SharedWork workOfRanks(std::span<const PartCost> parts, ImageSize size, uint32_t ranks) {
  const PictureShares shares = sharePicture(parts, size, ranks);
  const PaintedParts painted(parts, size, shares.owners, ranks);
  SharedWork work{workOfTiles(size, shares.owners, ranks), 0};
  std::vector<double> prepared(ranks), to_paint(ranks), received(ranks);
  for (uint32_t rank = 0; rank < ranks; ++rank) to_paint[rank] = work.ranks[rank].paint;
  for (size_t n = 0; n < parts.size(); ++n) {
    const uint32_t preparer = shares.preparers[n];
    double prepare = parts[n].prepare;
    for (const Painted& one : painted.of(n)) {
      RankWork& painter = work.ranks[one.rank];
      const bool own = one.rank == preparer;
      double paint = paintCost(parts[n]);
      if (ranks > 1) paint += own ? kKeepCost : kReceiveCost;
      painter.paint += paint * one.splats;
      received[one.rank] += paint * one.splats;
      painter.splats += one.splats;
      if (own) continue;
      painter.splats_received += one.splats;
      prepare += kSendCost * one.splats;
    }
    RankWork& rank = work.ranks[preparer];
    rank.prepare += prepare;
    rank.bytes += parts[n].bytes;
    ++rank.bricks;
    prepared[preparer] += prepare;
    if ((n + 1) % partsARound(ranks) != 0 && n + 1 < parts.size()) continue;
    const double until = *std::max_element(prepared.begin(), prepared.end());
    work.longest += until;
    for (uint32_t of_round = 0; of_round < ranks; ++of_round) {
      const double waited = until - std::exchange(prepared[of_round], 0);
      to_paint[of_round] = std::max(0.0, to_paint[of_round] - waited) + std::exchange(received[of_round], 0);
    }
  }
  work.longest += *std::max_element(to_paint.begin(), to_paint.end());
  return work;
}

}  // namespace curvisplat
