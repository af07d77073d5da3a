#include "render/cpu/splat_bins.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "render/cpu/tile.h"
#include "render/project/kernel.h"
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

SplatBins::SplatBins(ImageSize size, size_t splats, size_t entries, unsigned pieces)
    : columns_(tilesAlong(size.width)),
      rows_(tilesAlong(size.height)),
      most_splats_(splats),
      most_entries_(std::max(entries, tileCount(size))),
      pieces_(pieces),
      entries_(std::make_unique_for_overwrite<uint32_t[]>(most_entries_)),
      begins_(tileCount(size) + 1),
      piece_ends_(pieces * tileCount(size)),
      closed_(tileCount(size)) {
  splats_.reserve(splats + 3);
  tiles_.reserve(splats + 3);
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
  if (x1 < 0 || y1 < 0) return {1, 1, 0, 0};
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
    for (size_t n = 0; n < record_count_; ++n) {
      tiles_.push_back({1, 1, 0, 0});
      splats_.push_back(records_[n]);
    }
    record_count_ = 0;
    entry_count_ += tiles.count();
    tiles_.push_back(tiles);
    splats_.push_back(splats[added]);
  }
  return added;
}

template <typename Visit>
void SplatBins::forPiece(size_t piece, const Visit& visit) const {
  const size_t begin = splats_.size() * piece / pieces_, end = splats_.size() * (piece + 1) / pieces_;
  for (size_t n = begin; n < end; ++n) {
    const Tiles& tiles = tiles_[n];
    for (int y = tiles.y0; y <= tiles.y1; ++y)
      for (int x = tiles.x0; x <= tiles.x1; ++x) {
        const auto tile = static_cast<size_t>(y * columns_ + x);
        if (!closed_[tile]) visit(tile, n);
      }
  }
}

void SplatBins::sort() {
  const size_t tiles = begins_.size() - 1;
  std::fill(piece_ends_.begin(), piece_ends_.end(), 0);
  const auto forPieces = [&](const auto& visit) {
    tbb::parallel_for(size_t{0}, size_t{pieces_}, [&](size_t piece) {
      const TraceScope trace("sort bins");
      uint32_t* ends = &piece_ends_[piece * tiles];
      forPiece(piece, [&](size_t tile, size_t n) { visit(ends[tile], n); });
    });
  };
  forPieces([](uint32_t& count, size_t) { ++count; });
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
  forPieces([this](uint32_t& end, size_t n) { entries_[end++] = static_cast<uint32_t>(n); });
}

void SplatBins::open() {
  std::fill(closed_.begin(), closed_.end(), 0);
  hidden_ = 0;
  record_count_ = 0;
}

void SplatBins::clear() {
  splats_.clear();
  tiles_.clear();
  entry_count_ = 0;
}

}  // namespace curvisplat
