#include "render/project/pixel_layers.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/memory.h"

namespace curvisplat {
namespace {

constexpr float kClear = 1e-6f;

}  // namespace

void PixelLayers::Row::endPixel(size_t first_layer) {
  const auto begin = layers.begin() + static_cast<std::ptrdiff_t>(first_layer);
  const auto isNearer = [](const PixelLayer& a, const PixelLayer& b) { return a.depth < b.depth; };
  constexpr size_t kFew = 12;
  if (layers.size() <= first_layer + kFew) {
    for (size_t n = first_layer + 1; n < layers.size(); ++n)
      for (size_t at = n; at > first_layer && isNearer(layers[at], layers[at - 1]); --at)
        std::swap(layers[at], layers[at - 1]);
  } else {
    std::stable_sort(begin, layers.end(), isNearer);  // it allocates
  }
  size_t kept = first_layer;
  for (size_t n = first_layer; n < layers.size(); ++n) {
    const PixelLayer layer = layers[n];
    if (layer.colour.w < kClear) continue;
    if (kept > first_layer && layers[kept - 1].colour.w >= 1) break;
    if (kept - first_layer == kMaxLayers)
      layers[kept - 1].colour += (1 - layers[kept - 1].colour.w) * layer.colour;
    else
      layers[kept++] = layer;
  }
  layers.resize(kept);
  counts.push_back(static_cast<uint8_t>(kept - first_layer));
}

PixelLayers::PixelLayers(ImageSize size, std::vector<Row> rows, double depth_origin)
    : size_(size), depth_origin_(depth_origin) {
  std::vector<size_t> first_layer(rows.size() + 1), first_pixel(rows.size() + 1);
  for (size_t n = 0; n < rows.size(); ++n) {
    first_layer[n + 1] = first_layer[n] + rows[n].layers.size();
    first_pixel[n + 1] = first_pixel[n] + rows[n].counts.size();
  }
  CURVISPLAT_CHECK_OP(first_pixel.back(), ==, size.pixels());
  begins_.resize(size.pixels() + 1);
  layers_.reserve(first_layer.back());
  preferHugePages(layers_.data(), layers_.capacity() * sizeof(PixelLayer));
  layers_.resize(first_layer.back());
  tbb::parallel_for(size_t{0}, rows.size(), [&](size_t n) {
    auto begin = static_cast<uint32_t>(first_layer[n]);
    for (size_t pixel = 0; pixel < rows[n].counts.size(); ++pixel)
      begins_[first_pixel[n] + pixel + 1] = begin += rows[n].counts[pixel];
    std::copy(rows[n].layers.begin(), rows[n].layers.end(),
              layers_.begin() + static_cast<std::ptrdiff_t>(first_layer[n]));
    rows[n] = {};
  });
  makeLevels();
}

void PixelLayers::makeLevels() {
  const auto cellsAlong = [](int pixels) { return (pixels + kCellSide - 1) / kCellSide; };
  Level finest{cellsAlong(size_.width), cellsAlong(size_.height), {}};
  finest.cells.resize(static_cast<size_t>(finest.columns) * static_cast<size_t>(finest.rows));
  std::vector<int> windows(static_cast<size_t>(finest.rows));
  tbb::parallel_for(0, finest.rows, [&](int row) {
    for (int y = row * kCellSide; y < std::min((row + 1) * kCellSide, size_.height); ++y)
      for (int x = 0; x < size_.width; ++x) {
        const std::span<const PixelLayer> layers = at(x, y);
        Bounds& cell = finest.cells[static_cast<size_t>(row * finest.columns + x / kCellSide)];
        int& of_row = windows[static_cast<size_t>(row)];
        of_row = std::max(of_row, windowsOf(layers));
        if (!layers.empty()) cell.nearest = std::min(cell.nearest, layers.front().depth);
        const bool opaque = !layers.empty() && layers.back().colour.w >= 1;
        cell.hidden = std::max(cell.hidden, opaque ? layers.back().depth : kNowhere);
      }
  });
  windows_ = std::max(1, *std::max_element(windows.begin(), windows.end()));
  levels_.push_back(std::move(finest));
  while (levels_.back().columns > 1 || levels_.back().rows > 1) {
    const Level& below = levels_.back();
    Level level{(below.columns + 1) / 2, (below.rows + 1) / 2, {}};
    level.cells.resize(static_cast<size_t>(level.columns) * static_cast<size_t>(level.rows));
    for (int y = 0; y < below.rows; ++y)
      for (int x = 0; x < below.columns; ++x) {
        const Bounds& from = below.cells[static_cast<size_t>(y * below.columns + x)];
        Bounds& to = level.cells[static_cast<size_t>(y / 2 * level.columns + x / 2)];
        to.nearest = std::min(to.nearest, from.nearest);
        to.hidden = std::max(to.hidden, from.hidden);
      }
    levels_.push_back(std::move(level));
  }
}

PixelLayers::Bounds PixelLayers::boundsOver(const ScreenBox& box) const {
  // No numbers, of a splat larger than single precision: its layers may lie anywhere.
  if (!(box.x0 <= box.x1 && box.y0 <= box.y1)) return {-kNowhere, kNowhere};
  const auto cellOf = [](float at, int pixels) {
    return static_cast<int>(std::clamp(at, 0.0f, static_cast<float>(pixels - 1))) / kCellSide;
  };
  int x0 = cellOf(box.x0, size_.width), x1 = cellOf(box.x1, size_.width);
  int y0 = cellOf(box.y0, size_.height), y1 = cellOf(box.y1, size_.height);
  size_t level = 0;
  for (; x1 - x0 > 1 || y1 - y0 > 1; ++level) x0 /= 2, x1 /= 2, y0 /= 2, y1 /= 2;
  Bounds bounds;
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      const Bounds& cell = levels_[level].cells[static_cast<size_t>(y * levels_[level].columns + x)];
      bounds.nearest = std::min(bounds.nearest, cell.nearest);
      bounds.hidden = std::max(bounds.hidden, cell.hidden);
    }
  return bounds;
}

std::vector<PixelLayers::Bounds> PixelLayers::allBounds() const {
  std::vector<Bounds> all;
  for (const Level& level : levels_) all.insert(all.end(), level.cells.begin(), level.cells.end());
  return all;
}

uint64_t PixelLayers::bytes() const {
  uint64_t bytes = begins_.size() * sizeof(uint32_t) + layers_.size() * sizeof(PixelLayer);
  for (const Level& level : levels_) bytes += level.cells.size() * sizeof(Bounds);
  return bytes;
}

}  // namespace curvisplat
