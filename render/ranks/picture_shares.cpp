#include "render/ranks/picture_shares.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>
#include <utility>

#include "render/project/tile_set.h"
#include "render/ranks/tile_dealer.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// A round has this share of the parts that are left, and at least this many parts for each rank.
constexpr double kShareOfRound = 0.25;
constexpr size_t kMinOfRound = 2;
// How often parts, and tiles, are dealt out, and how far tiles' costs are changed each time: the power of the ratio.
constexpr int kPartPasses = 4, kTilePasses = 6;
constexpr double kTileStep = 0.5;
// Dealing out again cannot gain more than this.
constexpr double kGoodEnough = 1.005;

/// Splats of a part that a rank paints.
struct Painted {
  uint32_t rank;
  double splats;
  double inside;  // of them, those whose centres lie in its tiles: as many pixels as it paints of all
};

/// Who paints how many splats of each part. Splats near the border of a rank's tiles are painted by its neighbour, too.
class PaintedParts {
 public:
  PaintedParts(std::span<const PartCost> parts, ImageSize size, const std::vector<uint32_t>& owners,
               uint32_t ranks)
      : columns_(TileSet::tilesAlong(size.width, kSharedTileSide)),
        rows_(TileSet::tilesAlong(size.height, kSharedTileSide)),
        owners_(owners),
        of_part_(ranks),
        inside_(ranks) {
    for (const PartCost& part : parts) {
      addPart(part, size);
      double& most = most_.emplace_back();
      for (const uint32_t rank : ranks_of_part_) {
        most = std::max(most, of_part_[rank]);
        painted_.push_back({rank, of_part_[rank], inside_[rank]});
        of_part_[rank] = inside_[rank] = 0;
      }
      ranks_of_part_.clear();
      ends_.push_back(painted_.size());
    }
  }

  /// How many of a part's splats one rank paints, that which paints most.
  double mostOf(size_t part) const { return most_[part]; }
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
    for (int y = static_cast<int>(part.y0); y < part.y1; ++y)
      for (int x = static_cast<int>(part.x0); x < part.x1; ++x) {
        const uint32_t owner = ownerOf(x, y);
        const double splats = part.splats * part.along(false, x, x + 1) * part.along(true, y, y + 1);
        add(owner, splats);
        inside_[owner] += splats;
        for (const auto& [dx, dy] : {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
          uint32_t last = owner;
          for (int n = 1; n - 1 < part.reach; ++n) {
            const int column = x + n * dx, row = y + n * dy;
            if (column < 0 || column >= columns_ || row < 0 || row >= rows_) break;
            const uint32_t other = ownerOf(column, row);
            if (other != last) add(other, splats * std::min(1.0, part.reach - (n - 1)));
            last = other;
          }
        }
      }
  }

  const int columns_, rows_;
  const std::vector<uint32_t>& owners_;
  std::vector<Painted> painted_;          // of one part after the other
  std::vector<size_t> ends_;              // [part] in them
  std::vector<double> most_;              // [part]
  std::vector<double> of_part_, inside_;  // [rank] splats; those whose centres lie in its tiles
  std::vector<uint32_t> ranks_of_part_;
};

/// The cost for a rank that paints some of a part's splats: sorting and painting them.
double paintCost(const PartCost& part, const Painted& painted) {
  if (!(part.splats > 0)) return 0;
  return (part.sort * painted.splats + part.paint * painted.inside) / part.splats;
}

/// The cost of each rank's tiles before any splat is painted.
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

/// [rank] what it should prepare after the first round, so that all have the same sum of both: sum, less what they paint, but at
/// least 0.
std::vector<double> quotasOf(const std::vector<double>& paint, double prepare) {
  std::vector<double> sorted = paint;
  std::sort(sorted.begin(), sorted.end());
  double sum = 0, level = 0;  // of the first ones, filled up to the same level
  for (size_t n = 0; n < sorted.size(); ++n) {
    sum += sorted[n];
    level = (sum + prepare) / static_cast<double>(n + 1);
    if (n + 1 == sorted.size() || level <= sorted[n + 1]) break;
  }
  std::vector<double> quotas;
  for (const double of_rank : paint) quotas.push_back(std::max(0.0, level - of_rank));
  return quotas;
}

/// [part] the rank that prepares it.   paint [rank]
std::vector<uint32_t> dealParts(std::span<const PartCost> parts, const PaintedParts& painted,
                                const std::vector<double>& paint) {
  const auto ranks = static_cast<uint32_t>(paint.size());
  double total = 0, dealt = 0;
  for (const PartCost& part : parts) total += part.prepare;
  const std::vector<size_t> ends = roundEnds(parts.size(), ranks);
  // In the first round nobody has anything to paint yet: there all have the same.
  double first = 0;
  for (size_t part = 0; !ends.empty() && part < ends[0]; ++part) first += parts[part].prepare;
  const std::vector<double> quotas = quotasOf(paint, total - first);
  std::vector<double> loads(ranks), allowed(ranks);
  std::vector<uint32_t> preparers(parts.size()), round;
  struct Space {
    double left, load;  // load: when it was entered; what has changed since is entered anew
    uint32_t rank;
    bool operator<(const Space& other) const {
      return std::pair(left, other.rank) < std::pair(other.left, rank);
    }
  };
  size_t begin = 0;
  for (const size_t end : ends) {
    round.resize(end - begin);
    std::iota(round.begin(), round.end(), static_cast<uint32_t>(begin));
    begin = end;
    for (const uint32_t part : round) dealt += parts[part].prepare;
    const double share = total > first ? (dealt - first) / (total - first) : 0;
    for (uint32_t rank = 0; rank < ranks; ++rank) allowed[rank] = first / ranks + quotas[rank] * share;
    std::stable_sort(round.begin(), round.end(),
                     [&](uint32_t a, uint32_t b) { return painted.mostOf(a) > painted.mostOf(b); });
    std::priority_queue<Space> spaces;
    const auto enter = [&](uint32_t rank) { spaces.push({allowed[rank] - loads[rank], loads[rank], rank}); };
    for (uint32_t rank = 0; rank < ranks; ++rank) enter(rank);
    for (const uint32_t part : round) {
      const double prepare = parts[part].prepare;
      const Painted* most = nullptr;
      for (const Painted& one : painted.of(part))
        if (loads[one.rank] + 0.5 * prepare <= allowed[one.rank] && (!most || one.splats > most->splats))
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
      paint[one.rank] += paintCost(parts[n], one) + kReceiveCost * one.splats;
  return paint;
}

/// `tiles`: what those take.   preparers [part]
SharedWork workOf(std::span<const PartCost> parts, const PaintedParts& painted, std::vector<RankWork> tiles,
                  const std::vector<uint32_t>& preparers) {
  const auto ranks = static_cast<uint32_t>(tiles.size());
  SharedWork work{std::move(tiles), 0};
  std::vector<double> prepared(ranks), to_paint(ranks), received(ranks);
  const std::vector<size_t> ends = roundEnds(parts.size(), ranks);
  auto end = ends.begin();
  for (uint32_t rank = 0; rank < ranks; ++rank) to_paint[rank] = work.ranks[rank].paint;
  for (size_t n = 0; n < parts.size(); ++n) {
    const uint32_t preparer = preparers[n];
    double prepare = parts[n].prepare;
    for (const Painted& one : painted.of(n)) {
      RankWork& painter = work.ranks[one.rank];
      const bool own = one.rank == preparer;
      double paint = paintCost(parts[n], one);
      if (ranks > 1) paint += (own ? kKeepCost : kReceiveCost) * one.splats;
      painter.paint += paint;
      received[one.rank] += paint;
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
    if (n + 1 < *end) continue;
    ++end;
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

/// Deals the parts out several times: what a rank sends and receives depends on what it prepares. The best counts.
SharedWork shareParts(std::span<const PartCost> parts, const PaintedParts& painted,
                      const std::vector<RankWork>& tiles, std::vector<uint32_t>& preparers) {
  std::vector<double> paint = paintOf(parts, painted, tiles);
  SharedWork best;
  for (int pass = 0; pass < kPartPasses; ++pass) {
    std::vector<uint32_t> dealt = dealParts(parts, painted, paint);
    SharedWork work = workOf(parts, painted, tiles, dealt);
    for (size_t rank = 0; rank < paint.size(); ++rank)
      paint[rank] = work.ranks[rank].prepare + work.ranks[rank].paint;
    for (size_t n = 0; n < parts.size(); ++n) paint[dealt[n]] -= parts[n].prepare;
    if (pass > 0 && work.longest >= best.longest) continue;
    best = std::move(work);
    preparers = std::move(dealt);
  }
  return best;
}

/// Deals the tiles out several times: how many splats of its neighbours' tiles a rank sorts depends on where its own end. The
/// best counts.
SharedWork shareAndWork(std::span<const PartCost> parts, ImageSize size, uint32_t ranks,
                        PictureShares& best_shares) {
  const std::vector<double> plain = tileCosts(parts, size);
  std::vector<double> costs = plain;
  SharedWork best;
  for (int pass = 0; pass < kTilePasses; ++pass) {
    PictureShares shares{dealTiles(costs, size, ranks), {}};
    const PaintedParts painted(parts, size, shares.owners, ranks);
    SharedWork work = shareParts(parts, painted, workOfTiles(size, shares.owners, ranks), shares.preparers);
    std::vector<double> without(ranks);
    for (size_t tile = 0; tile < plain.size(); ++tile) without[shares.owners[tile]] += plain[tile];
    for (size_t tile = 0; tile < plain.size(); ++tile) {
      const uint32_t owner = shares.owners[tile];
      const double factor = work.ranks[owner].paint / without[owner];
      costs[tile] =
          plain[tile] * std::pow(costs[tile] / plain[tile], 1 - kTileStep) * std::pow(factor, kTileStep);
    }
    if (pass > 0 && work.longest >= best.longest) continue;
    best = std::move(work);
    best_shares = std::move(shares);
    double all = 0;
    for (const RankWork& rank : best.ranks) all += rank.prepare + rank.paint;
    if (best.longest * ranks <= kGoodEnough * all) break;
  }
  return best;
}

}  // namespace

std::vector<size_t> roundEnds(size_t parts, uint32_t ranks) {
  const size_t least = kMinOfRound * ranks;
  std::vector<size_t> ends;
  for (size_t end = 0; end < parts; ends.push_back(end)) {
    const auto left = static_cast<double>(parts - end);
    end = std::min(parts, end + std::max(least, static_cast<size_t>(kShareOfRound * left)));
  }
  return ends;
}

PictureShares sharePicture(std::span<const PartCost> parts, ImageSize size, uint32_t ranks) {
  PictureShares shares;
  shareAndWork(parts, size, ranks, shares);
  return shares;
}

SharedWork workOfRanks(std::span<const PartCost> parts, ImageSize size, uint32_t ranks) {
  PictureShares shares;
  return shareAndWork(parts, size, ranks, shares);
}

namespace {

/// Calls use(first float, count) for each row of pixels of each tile of `rank`, in order.
template <typename Use>
void forRowsOf(uint32_t rank, const std::vector<uint32_t>& owners, Image& image, const Use& use) {
  const auto columns = static_cast<size_t>(TileSet::tilesAlong(image.size.width, kSharedTileSide));
  for (size_t tile = 0; tile < owners.size(); ++tile) {
    if (owners[tile] != rank) continue;
    const int x0 = static_cast<int>(tile % columns) * kSharedTileSide,
              y0 = static_cast<int>(tile / columns) * kSharedTileSide;
    const auto floats = 4 * static_cast<size_t>(std::min(kSharedTileSide, image.size.width - x0));
    for (int y = y0; y < std::min(y0 + kSharedTileSide, image.size.height); ++y)
      use(image.pixel(x0, y), floats);
  }
}

}  // namespace

void joinTiles(Image& image, const std::vector<uint32_t>& owners, Ranks& ranks) {
  std::vector<float> own;
  if (!ranks.isFirst())
    forRowsOf(ranks.rank(), owners, image,
              [&](const float* row, size_t floats) { own.insert(own.end(), row, row + floats); });
  const std::vector<Ranks::Bytes> parts = ranks.gather(toBytes(own));
  for (uint32_t rank = 1; rank < parts.size(); ++rank) {
    const std::vector<float> part = fromBytes<float>(parts[rank]);
    size_t at = 0;
    forRowsOf(rank, owners, image, [&](float* row, size_t floats) {
      CURVISPLAT_CHECK_OP(at + floats, <=, part.size());
      std::copy_n(&part[at], floats, row);
      at += floats;
    });
    CURVISPLAT_CHECK_OP(at, ==, part.size());
  }
}

}  // namespace curvisplat
