#include "render/tiles/splat_bins.h"

#include <algorithm>
#include <cmath>

#include "render/project/footprint.h"
#include "stream/base/error.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

int tilesAlong(int pixels) {
  return (pixels + kTileSide - 1) / kTileSide;
}

size_t tileCount(ImageSize size) {
  return static_cast<size_t>(tilesAlong(size.width)) * static_cast<size_t>(tilesAlong(size.height));
}

}  // namespace

// The tiles of splats that touch none, and of records, which are in no list.
constexpr SplatBins::Tiles SplatBins::kNoTiles{1, 1, 0, 0};

SplatBins::SplatBins(ImageSize size, size_t splats, size_t entries, unsigned pieces)
    : columns_(tilesAlong(size.width)),
      rows_(tilesAlong(size.height)),
      most_splats_(splats),
      most_entries_(std::max(entries, tileCount(size))),
      pieces_(pieces),
      tiles_(std::make_unique_for_overwrite<Tiles[]>(splats + 3)),
      entries_(std::make_unique_for_overwrite<uint32_t[]>(most_entries_)),
      begins_(tileCount(size) + 1),
      piece_ends_(pieces * tileCount(size)),
      closed_(tileCount(size)) {
  splats_.reserve(splats + 3);
}

uint64_t SplatBins::bytes(ImageSize size, size_t splats, size_t entries, unsigned pieces) {
  return (splats + 3) * (sizeof(ScreenSplat) + sizeof(Tiles)) +
         sizeof(uint32_t) * (std::max(entries, tileCount(size)) + pieces * tileCount(size)) +
         sizeof(size_t) * (tileCount(size) + 1) + tileCount(size);
}

SplatBins::Tiles SplatBins::tilesOf(const ScreenSplat& splat) const {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  constexpr float kTile = 1.0f / kTileSide;
  const float reach_x = kSupport * splat.l11;
  const float reach_y = kSupport * std::sqrt(splat.l21 * splat.l21 + splat.l22 * splat.l22);
  const auto columns = static_cast<float>(columns_), rows = static_cast<float>(rows_);
  // The half pixel between edges and centres is left as a margin.
  const auto first = [](float x, float most) {
    return static_cast<uint16_t>(std::clamp(x * kTile, 0.0f, most));
  };
  const auto last = [](float x, float most) {
    return static_cast<int>(std::clamp(x * kTile + 1, 0.0f, most)) - 1;
  };
  const int x1 = last(splat.x + reach_x, columns), y1 = last(splat.y + reach_y, rows);
  if (x1 < 0 || y1 < 0) return kNoTiles;
  return {first(splat.x - reach_x, columns), first(splat.y - reach_y, rows), static_cast<uint16_t>(x1),
          static_cast<uint16_t>(y1)};
}

bool SplatBins::allClosed(const Tiles& tiles) const {
  for (int y = tiles.y0; y <= tiles.y1; ++y)
    for (int x = tiles.x0; x <= tiles.x1; ++x)
      if (!closed_[static_cast<size_t>(y * columns_ + x)]) return false;
  return true;
}

size_t SplatBins::add(std::span<const ScreenSplat> splats) {
  size_t added = 0;
  for (; added < splats.size() && splats_.size() < most_splats_; ++added) {
    if (isRecord(splats[added])) {
      records_[record_count_++ % records_.size()] = splats[added];
      continue;
    }
    const Tiles tiles = tilesOf(splats[added]);
    if (allClosed(tiles)) {
      ++hidden_;
      record_count_ = 0;
      continue;
    }
    if (entry_count_ + tiles.count() > most_entries_) break;
    for (size_t n = 0; n < record_count_; ++n) push(records_[n], kNoTiles);
    record_count_ = 0;
    entry_count_ += tiles.count();
    push(splats[added], tiles);
  }
  batch_ = splats_;
  return added;
}

void SplatBins::push(const ScreenSplat& splat, const Tiles& tiles) {
  tiles_[splats_.size()] = tiles;
  splats_.push_back(splat);
}

/// visit(piece, its first splat, its end)
template <typename Visit>
void SplatBins::forPieces(PaintLoop& loop, const Visit& visit) const {
  loop.forAll("sort bins", pieces_, 1, [&](size_t piece) {
    visit(piece, batch_.size() * piece / pieces_, batch_.size() * (piece + 1) / pieces_);
  });
}

/// Returns how many there are.
template <typename Visit>
size_t SplatBins::forOpenTiles(size_t n, const Visit& visit) const {
  const Tiles& tiles = tiles_[n];
  size_t open = 0;
  for (int y = tiles.y0; y <= tiles.y1; ++y)
    for (int x = tiles.x0; x <= tiles.x1; ++x) {
      const auto tile = static_cast<size_t>(y * columns_ + x);
      if (closed_[tile]) continue;
      visit(tile);
      ++open;
    }
  return open;
}

size_t SplatBins::sortBorrowed(std::span<const ScreenSplat> splats, PaintLoop& loop) {
  CURVISPLAT_CHECK(empty() && !awaitsSplat());
  const auto withoutLastRecords = [](std::span<const ScreenSplat> of) {
    while (!of.empty() && isRecord(of.back())) of = of.first(of.size() - 1);
    return of;
  };
  size_t most = std::min(splats.size(), most_splats_);
  while (most < splats.size() && isRecord(splats[most - 1])) ++most;
  batch_ = withoutLastRecords(splats.first(most));
  std::atomic<uint64_t> entries = 0, hidden = 0;
  forPieces(loop, [&](size_t piece, size_t begin, size_t end) {
    uint64_t of_piece = 0;
    for (size_t n = begin; n < end; ++n) {
      tiles_[n] = isRecord(batch_[n]) ? kNoTiles : tilesOf(batch_[n]);
      of_piece += tiles_[n].count();
    }
    entries += of_piece;
    hidden += countPiece(piece, begin, end);
  });
  if (entries > most_entries_) {
    batch_ = withoutLastRecords(batch_.first(fitting()));
    sort(loop);
  } else {
    hidden_ += hidden;
    writeEntries(loop);
  }
  return batch_.size();
}

/// How many of the batch's splats, from the first on, there is space for.
size_t SplatBins::fitting() const {
  size_t entries = 0, n = 0;
  while (n < batch_.size() && (entries += tiles_[n].count()) <= most_entries_) ++n;
  return n;
}

void SplatBins::sort(PaintLoop& loop) {
  forPieces(loop, [&](size_t piece, size_t begin, size_t end) { hidden_ += countPiece(piece, begin, end); });
  writeEntries(loop);
}

/// Counts the entries of each tile in a piece. Returns how many of its splats touch no open tile.
uint64_t SplatBins::countPiece(size_t piece, size_t begin, size_t end) {
  const size_t tiles = begins_.size() - 1;
  uint32_t* const counts = &piece_ends_[piece * tiles];
  std::fill_n(counts, tiles, 0);
  uint64_t hidden = 0;
  for (size_t n = begin; n < end; ++n)
    if (forOpenTiles(n, [&](size_t tile) { ++counts[tile]; }) == 0 && !isRecord(batch_[n])) ++hidden;
  return hidden;
}

void SplatBins::writeEntries(PaintLoop& loop) {
  sumCounts();
  const size_t tiles = begins_.size() - 1;
  forPieces(loop, [&](size_t piece, size_t begin, size_t end) {
    uint32_t* const ends = &piece_ends_[piece * tiles];
    for (size_t n = begin; n < end; ++n)
      forOpenTiles(n, [&](size_t tile) { entries_[ends[tile]++] = static_cast<uint32_t>(n); });
  });
}

/// Turns the number of entries that a piece has for each tile into the place where it writes them.
void SplatBins::sumCounts() {
  const TraceScope trace("sum bins");
  const size_t tiles = begins_.size() - 1;
  uint32_t sum = 0;
  for (size_t tile = 0; tile < tiles; ++tile) {
    begins_[tile] = sum;
    for (size_t piece = 0; piece < pieces_; ++piece) {
      const uint32_t count = piece_ends_[piece * tiles + tile];
      piece_ends_[piece * tiles + tile] = sum;
      sum += count;
    }
  }
  begins_[tiles] = sum;
}

void SplatBins::open() {
  std::fill(closed_.begin(), closed_.end(), 0);
  hidden_ = 0;
  record_count_ = 0;
}

void SplatBins::clear() {
  splats_.clear();
  batch_ = {};
  entry_count_ = 0;
}

}  // namespace curvisplat
