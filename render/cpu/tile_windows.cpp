#include "render/cpu/tile_windows.h"

#include <algorithm>
#include <new>

namespace curvisplat {
namespace {

int tilesAlong(int pixels) {
  return (pixels + kTileSide - 1) / kTileSide;
}

/// The place of a pixel of a tile, in the order of its floats.
size_t placeOf(int x, int y) {
  const int block = y / kBlockSide * kTileBlocks + x / kBlockSide;
  return static_cast<size_t>(block * kBlockPixels + y % kBlockSide * kBlockSide + x % kBlockSide);
}

}  // namespace

std::vector<WindowTiles::Needs> WindowTiles::needsOf(const PixelLayers& layers) {
  const ImageSize size = layers.size();
  std::vector<Needs> needs(static_cast<size_t>(tilesAlong(size.width)) *
                           static_cast<size_t>(tilesAlong(size.height)));
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const auto at = layers.at(x, y);
      if (at.empty()) continue;
      Needs& of = needs[static_cast<size_t>(y / kTileSide * tilesAlong(size.width) + x / kTileSide)];
      of.layers = std::max(of.layers, static_cast<int>(at.size()));
      of.windows = std::max(of.windows, PixelLayers::windowsOf(at));
    }
  return needs;
}

uint64_t WindowTiles::bytes(const PixelLayers& layers) {
  uint64_t floats = 0;
  for (const Needs& needs : needsOf(layers)) floats += needs.floats();
  return sizeof(float) * floats;
}

void WindowTiles::begin(const PixelLayers* layers, PaintLoop& loop) {
  offsets_.clear();
  tiles_.clear();
  if (!layers || layers->empty()) return;
  const std::vector<Needs> needs = needsOf(*layers);
  size_t floats = 0;
  for (const Needs& of : needs) floats += of.floats();
  if (floats > capacity_ || floats < capacity_ / 4) {
    floats_.reset();
    capacity_ = 0;
    floats_ = hwy::AllocateAligned<float>(floats);
    if (!floats_) throw std::bad_alloc();
    capacity_ = floats;
  }
  std::vector<float*> places;
  std::vector<uint32_t> numbers;
  float* at = floats_.get();
  for (size_t number = 0; number < needs.size(); ++number) {
    offsets_.push_back(needs[number].layers == 0 ? kNone : static_cast<uint32_t>(numbers.size()));
    if (needs[number].layers == 0) continue;
    numbers.push_back(static_cast<uint32_t>(number));
    places.push_back(at);
    at += needs[number].floats();
  }
  tiles_.resize(numbers.size());
  loop.forAll("fill windows", numbers.size(), 1,
              [&](size_t n) { fill(*layers, numbers[n], needs[numbers[n]], places[n], tiles_[n]); });
}

void WindowTiles::fill(const PixelLayers& layers, size_t number, const Needs& needs, float* at,
                       TileWindows& tile) {
  constexpr size_t kPixels = size_t{kTileSide} * kTileSide;
  const ImageSize size = layers.size();
  const auto columns = static_cast<size_t>(tilesAlong(size.width));
  const int x0 = static_cast<int>(number % columns) * kTileSide,
            y0 = static_cast<int>(number / columns) * kTileSide;
  tile.layers = needs.layers;
  tile.depths = at;
  tile.behind = at + static_cast<size_t>(needs.layers) * kPixels;
  tile.open.fill(0);
  std::fill(at, tile.behind, PixelLayers::kNowhere);
  std::fill_n(tile.behind, static_cast<size_t>(needs.windows - 1) * kTileFloats, 0.0f);
  for (int y = 0; y < std::min(kTileSide, size.height - y0); ++y)
    for (int x = 0; x < std::min(kTileSide, size.width - x0); ++x) {
      const auto of_pixel = layers.at(x0 + x, y0 + y);
      const size_t place = placeOf(x, y), block = place / kBlockPixels, lane = place % kBlockPixels;
      const int windows = PixelLayers::windowsOf(of_pixel);
      tile.open[block] = std::max(tile.open[block], static_cast<uint8_t>(windows));
      for (size_t n = 0; n < of_pixel.size(); ++n) at[n * kPixels + place] = of_pixel[n].depth;
      for (int window = 1; window < windows; ++window)
        tile.behind[static_cast<size_t>(window - 1) * kTileFloats + block * kBlockFloats + 3 * kBlockPixels +
                    lane] = 1;
    }
}

}  // namespace curvisplat
