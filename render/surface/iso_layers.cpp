#include "render/surface/iso_layers.h"

#include <fmt/format.h>

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numeric>

#include "render/image/too_little_memory.h"
#include "render/project/tile_set.h"
#include "render/surface/surface_shader.h"
#include "stream/base/error.h"
#include "stream/model/corrections.h"

namespace curvisplat {
namespace {

constexpr int kPixels = kTileSide * kTileSide;
constexpr int kSeenSide = kTileSide + 2;  // with the pixels around the tile
constexpr int kBlock = 4, kBlocks = kTileSide / kBlock;
// Rays of a pixel at an outline, from its middle: // no two in a row or a column of eight.
constexpr std::array<std::array<float, 2>, 8> kOffsets{{{0.0625f, -0.1875f},
                                                        {-0.0625f, 0.1875f},
                                                        {0.3125f, 0.0625f},
                                                        {-0.1875f, -0.3125f},
                                                        {-0.3125f, 0.3125f},
                                                        {-0.4375f, -0.0625f},
                                                        {0.1875f, 0.4375f},
                                                        {0.4375f, -0.4375f}}};
constexpr double kFold = 4;          // pixels, between the depths of neighbours
constexpr float kGrazing = 0.25f;    // the cosine between ray and normal
constexpr double kSameLayer = 8;     // pixels, between the rays of one pixel
constexpr double kOwnLayers = 1e-3;  // of what still comes through
constexpr uint64_t kAlone = 2;  // times the memory, for a tile that one thread traces while the others wait

/// The finding of a pixel's middle ray, to be compared with its neighbours.
struct Seen {
  size_t count = 0;
  double depth = 0;
  bool grazing = false;
};

}  // namespace

/// The work of one thread.
class IsoLayers::Tracer {
 public:
  Tracer(const IsoSplats& splats, const Look& look)
      : splats_(splats),
        view_(splats.settings().view),
        perspective_(view_.projection == Projection::kPerspective),
        look_(look),
        light_(look.light, view_),
        rays_(splats.settings()) {}

  /// The memory that draw() takes for a tile's splats.
  static uint64_t bytes(std::span<const IsoSplats::Placed> splats, int x0, int y0) {
    const auto counts = countRows(splats, y0);
    return kOwnBytes +
           std::accumulate(counts.begin(), counts.end(), uint64_t{0}) * sizeof(IsoSplats::Placed) +
           IsoRays::bytes(mostOfPackets(splats, x0, y0));
  }

  void draw(size_t number, int x0, int y0, Tile& tile) {
    x0_ = x0;
    y0_ = y0;
    width_ = std::min(kTileSide, view_.size.width - x0);
    height_ = std::min(kTileSide, view_.size.height - y0);
    sortRows(number);
    for (auto& pixel : pixels_) pixel.clear();
    seen_.fill({});
    for (int y = 0; y < kTileSide; y += kBlock)
      for (int x = 0; x < kTileSide; x += kBlock) trace({x, y, x + kBlock, y + kBlock});
    if (correctionsToMake().isosurfaces.smooth) {
      traceAround();
      for (int row = 0; row < kBlocks; ++row)
        for (int column = 0; column < kBlocks; ++column) smoothBlock(column, row);
    }
    tile.begins.assign(1, 0);
    for (const auto& pixel : pixels_) {
      tile.layers.insert(tile.layers.end(), pixel.begin(), pixel.end());
      tile.begins.push_back(static_cast<uint32_t>(tile.layers.size()));
    }
  }

 private:
  static constexpr uint64_t kOwnBytes = 1 << 19;  // itself, and the layers of its pixels

  struct Pixel {
    int x, y;  // from the tile's first
  };
  struct BlockRange {
    size_t first, last;
  };
  /// The blocks along an axis of the tile, from `begin` on, that lie between two places; the first and the last have the
  /// pixels beside the tile as well.
  static BlockRange blocksOf(float from, float to, int begin) {
    const auto at = [&](float place) {
      return static_cast<size_t>(
          std::clamp((place - static_cast<float>(begin)) / kBlock, 0.0f, kBlocks - 0.5f));
    };
    return {at(from), at(to)};
  }
  static BlockRange rowsOf(const IsoSplat& splat, int y0) { return blocksOf(splat.y0, splat.y1, y0); }
  static std::array<size_t, kBlocks> countRows(std::span<const IsoSplats::Placed> splats, int y0) {
    std::array<size_t, kBlocks> counts{};
    for (const IsoSplats::Placed& placed : splats) {
      const BlockRange rows = rowsOf(*placed.splat, y0);
      for (size_t row = rows.first; row <= rows.last; ++row) ++counts[row];
    }
    return counts;
  }

  /// The most splats that touch a packet: a block of 4x4 pixels, or a half of the row above or below the tile.
  static size_t mostOfPackets(std::span<const IsoSplats::Placed> splats, int x0, int y0) {
    std::array<size_t, kBlocks * kBlocks> counts{};
    std::array<size_t, 4> of_halves{};
    for (const IsoSplats::Placed& placed : splats) {
      const IsoSplat& splat = *placed.splat;
      const BlockRange across = blocksOf(splat.x0, splat.x1, x0), down = blocksOf(splat.y0, splat.y1, y0);
      for (size_t row = down.first; row <= down.last; ++row)
        for (size_t column = across.first; column <= across.last; ++column) ++counts[row * kBlocks + column];
      for (size_t half = 2 * across.first / kBlocks; half <= 2 * across.last / kBlocks; ++half) {
        of_halves[half] += down.first == 0;
        of_halves[2 + half] += down.last == kBlocks - 1;
      }
    }
    return std::max(*std::max_element(counts.begin(), counts.end()),
                    *std::max_element(of_halves.begin(), of_halves.end()));
  }

  void sortRows(size_t number) {
    const auto splats = splats_.inTile(number);
    rays_.makeRoom(mostOfPackets(splats, x0_, y0_));
    const std::array<size_t, kBlocks> counts = countRows(splats, y0_);
    for (size_t row = 0; row < rows_.size(); ++row) {
      if (counts[row] > rows_[row].capacity()) rows_[row] = {};  // not beside the new one
      rows_[row].clear();
      rows_[row].reserve(counts[row]);
    }
    for (const IsoSplats::Placed& placed : splats) {
      const BlockRange rows = rowsOf(*placed.splat, y0_);
      for (size_t row = rows.first; row <= rows.last; ++row) rows_[row].push_back(placed);
    }
  }

  /// Pixels of the tile, or beside it: from (x0, y0) to before (x1, y1).
  struct Box {
    int x0, y0, x1, y1;
  };

  /// Traces the neighbours' outermost pixels, so that an outline on the edge of two tiles is found by both.
  /// Their splats are this tile's, too.
  void traceAround() {
    constexpr int kLong = kTileSide / 2;
    static_assert(kLong == int{IsoPacket::kRays});
    for (const int y : {-1, kTileSide})
      for (int x = 0; x < kTileSide; x += kLong) trace({x, y, x + kLong, y + 1});
    for (const int x : {-1, kTileSide})
      for (int y = 0; y < kTileSide; y += kBlock) trace({x, y, x + 1, y + kBlock});
  }

  /// One ray for each pixel of a box that lies in the picture.
  void trace(const Box& box) {
    IsoPacket packet = emptyPacket();
    std::array<Pixel, IsoPacket::kRays> pixels{};
    for (int y = std::max(box.y0, -y0_); y < std::min(box.y1, view_.size.height - y0_); ++y)
      for (int x = std::max(box.x0, -x0_); x < std::min(box.x1, view_.size.width - x0_); ++x) {
        pixels[packet.count] = {x, y};
        addRay(packet, {x, y}, {0, 0});
      }
    if (packet.count == 0) return;
    rays_.trace(packet, rows_[static_cast<size_t>(std::clamp(box.y0 / kBlock, 0, kBlocks - 1))]);
    for (size_t ray = 0; ray < packet.count; ++ray) {
      const auto hits = rays_.hits(ray).all();
      if (hits.empty()) continue;
      const auto [x, y] = pixels[ray];
      const glm::vec3 n = hits[0].gradient;
      const glm::vec3 along = perspective_ ? rayOf(packet.x[ray], packet.y[ray]) : glm::vec3(0, 0, 1);
      seenAt(x, y) = {hits.size(), hits[0].depth,
                      std::abs(glm::dot(n, along)) < kGrazing * glm::length(n) * glm::length(along)};
      if (x >= 0 && y >= 0 && x < kTileSide && y < kTileSide)
        merge(std::span(&ray, 1), packet, layersOf({x, y}));
    }
  }

  /// Again, with four rays, where something ends.
  void smoothBlock(int column, int row) {
    IsoPacket packet = emptyPacket();
    std::array<Pixel, IsoPacket::kRays> pixels{};
    const auto trace = [&] {
      if (packet.count == 0) return;
      rays_.trace(packet, rows_[static_cast<size_t>(row)]);
      for (size_t begin = 0; begin < packet.count; begin += kOffsets.size()) {
        std::array<size_t, kOffsets.size()> rays{};
        for (size_t n = 0; n < rays.size(); ++n) rays[n] = begin + n;
        auto& layers = layersOf(pixels[begin]);
        layers.clear();
        merge(rays, packet, layers);
      }
      packet.count = 0;
    };
    for (int y = row * kBlock; y < std::min((row + 1) * kBlock, height_); ++y)
      for (int x = column * kBlock; x < std::min((column + 1) * kBlock, width_); ++x) {
        if (!isOutline(x, y)) continue;
        for (const auto& offset : kOffsets) {
          pixels[packet.count] = {x, y};
          addRay(packet, {x, y}, offset);
        }
        if (packet.count == IsoPacket::kRays) trace();
      }
    trace();
  }

  bool isOutline(int x, int y) const {
    const Seen& own = seenAt(x, y);
    if (own.count > 0 && own.grazing) return true;
    for (const auto& [dx, dy] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
      // Nothing is seen beside the picture.
      if (x0_ + x + dx < 0 || y0_ + y + dy < 0 || x0_ + x + dx >= view_.size.width ||
          y0_ + y + dy >= view_.size.height)
        continue;
      const Seen& other = seenAt(x + dx, y + dy);
      if (own.count != other.count) return true;
      if (own.count > 0 && std::abs(own.depth - other.depth) > kFold * side(own.depth)) return true;
    }
    return false;
  }

  /// Layers of the crossings of a pixel's rays: those of different rays that lie close together make one.
  void merge(std::span<const size_t> rays, const IsoPacket& packet, std::vector<PixelLayer>& layers) const {
    std::array<size_t, kOffsets.size()> next{};
    std::array<float, kOffsets.size()> through;
    through.fill(1);
    while (true) {
      double nearest = INFINITY;
      float left = 0;
      for (size_t n = 0; n < rays.size(); ++n) {
        const auto hits = rays_.hits(rays[n]).all();
        left += through[n];
        if (next[n] < hits.size()) nearest = std::min(nearest, hits[next[n]].depth);
      }
      if (!std::isfinite(nearest) || left < kOwnLayers) return;
      PixelLayer layer{0, glm::vec4(0.0f), 0};
      double depth = 0, scalar = 0;
      float count = 0;
      for (size_t n = 0; n < rays.size(); ++n) {
        const auto hits = rays_.hits(rays[n]).all();
        if (next[n] == hits.size() || hits[next[n]].depth > nearest + kSameLayer * side(nearest)) continue;
        const IsoHit& hit = hits[next[n]++];
        const float alpha = look_.opacity.at(hit);
        layer.colour +=
            through[n] * alpha * glm::vec4(colourOf(hit, packet.x[rays[n]], packet.y[rays[n]]), 1.0f);
        through[n] *= 1 - alpha;
        scalar += double{look_.colours_of_other ? hit.other_scalar : hit.scalar};
        depth += depthOf(hit.depth, packet.x[rays[n]], packet.y[rays[n]]);
        ++count;
      }
      layer.colour /= left;
      layer.colour.w = std::min(layer.colour.w, 1.0f);
      layer.scalar = static_cast<float>(scalar / double{count});
      layer.depth = static_cast<float>(depth / double{count});
      layers.push_back(layer);
    }
  }

  glm::vec3 colourOf(const IsoHit& hit, float x, float y) const {
    const glm::dvec3 n(hit.gradient);
    // A gradient: in data coordinates it is larger where they are stretched.
    const glm::dvec3 of_data = view_.scale * (n.x * view_.right + n.y * view_.down + n.z * view_.forward);
    const std::optional<glm::vec3> own =
        look_.own_colours.empty() ? std::nullopt : look_.own_colours[hit.surface];
    const double scalar{look_.colours_of_other ? hit.other_scalar : hit.scalar};
    return light_.lit(own ? *own : look_.colours.at(scalar), glm::vec3(of_data), towardsViewer(view_, x, y));
  }

  IsoPacket emptyPacket() const {
    IsoPacket packet;
    packet.opacity = look_.opacity;
    return packet;
  }
  void addRay(IsoPacket& packet, const Pixel& pixel, const std::array<float, 2>& offset) const {
    packet.x[packet.count] = static_cast<float>(x0_ + pixel.x) + 0.5f + offset[0];
    packet.y[packet.count] = static_cast<float>(y0_ + pixel.y) + 0.5f + offset[1];
    ++packet.count;
  }
  static size_t seenPlace(int x, int y) { return static_cast<size_t>((y + 1) * kSeenSide + x + 1); }
  const Seen& seenAt(int x, int y) const { return seen_[seenPlace(x, y)]; }
  Seen& seenAt(int x, int y) { return seen_[seenPlace(x, y)]; }
  std::vector<PixelLayer>& layersOf(const Pixel& pixel) {
    return pixels_[static_cast<size_t>(pixel.y * kTileSide + pixel.x)];
  }
  double side(double depth) const { return (perspective_ ? depth : 1) / view_.focal_px; }
  /// The ray in view axes, at the depth 1.
  glm::vec3 rayOf(float x, float y) const {
    return {(double{x} - 0.5 * view_.size.width) / view_.focal_px,
            (double{y} - 0.5 * view_.size.height) / view_.focal_px, 1};
  }
  /// PixelLayers'.
  double depthOf(double along_view, float x, float y) const {
    return perspective_ ? along_view * double{glm::length(rayOf(x, y))} : along_view;
  }

  const IsoSplats& splats_;
  const ScreenView& view_;
  const bool perspective_;
  const Look& look_;
  const SurfaceLight light_;
  IsoRays rays_;
  int x0_ = 0, y0_ = 0, width_ = 0, height_ = 0;
  std::array<std::vector<IsoSplats::Placed>, kBlocks> rows_;
  std::array<std::vector<PixelLayer>, kPixels> pixels_;
  std::array<Seen, kSeenSide * kSeenSide> seen_;
};

IsoLayers::IsoLayers(ImageSize size)
    : size_(size),
      columns_((static_cast<size_t>(size.width) + kTileSide - 1) / kTileSide),
      tiles_(TileSet::tilesOf(size)) {}

void IsoLayers::drawTile(Tracer& tracer, size_t number) {
  tracer.draw(number, static_cast<int>(number % columns_) * kTileSide,
              static_cast<int>(number / columns_) * kTileSide, tiles_[number]);
}

/// The tile has no smaller part.
void IsoLayers::throwTooLarge(size_t number, uint64_t taken, uint64_t bytes) const {
  throw TooLittleMemory(
      fmt::format(
          "isosurfaces: the splats in the {0}x{0} pixels at {1},{2} are too many (they take {3} KiB, and "
          "have {4} KiB of the memory); give more --memory, or a larger --lod-pixels",
          kTileSide, number % columns_ * kTileSide, number / columns_ * kTileSide, taken >> 10, bytes >> 10),
      size_);
}

/// Tiles that all threads may trace at a time, then those that half of them may, and so on. Tracers keep what they took, so each
/// time new ones.
void IsoLayers::draw(const IsoSplats& splats, const Look& look, uint64_t bytes) {
  const TileRange& range = splats.settings().tiles;
  std::vector<uint64_t> bytes_of(range.count());
  tbb::parallel_for(size_t{0}, range.count(), [&](size_t n) {
    const size_t number = range.begin + n;
    if (splats.inTile(number).empty()) return;
    bytes_of[n] = Tracer::bytes(splats.inTile(number), static_cast<int>(number % columns_) * kTileSide,
                                static_cast<int>(number / columns_) * kTileSide);
  });
  for (size_t n = 0; n < range.count(); ++n)
    if (bytes_of[n] > kAlone * bytes) throwTooLarge(range.begin + n, bytes_of[n], kAlone * bytes);
  uint64_t drawn = 0;  // tiles that take no more
  for (int threads = tbb::this_task_arena::max_concurrency(); threads > 0; threads /= 2) {
    const uint64_t most = threads > 1 ? bytes / static_cast<uint64_t>(threads) : kAlone * bytes;
    std::vector<size_t> tiles;
    for (size_t n = 0; n < range.count(); ++n)
      if (bytes_of[n] > drawn && bytes_of[n] <= most) tiles.push_back(range.begin + n);
    drawn = most;
    tbb::enumerable_thread_specific<std::unique_ptr<Tracer>> tracers;
    tbb::task_arena arena(threads);
    arena.execute([&] {
      tbb::parallel_for(size_t{0}, tiles.size(), [&](size_t n) {
        std::unique_ptr<Tracer>& tracer = tracers.local();
        if (!tracer) tracer = std::make_unique<Tracer>(splats, look);
        drawTile(*tracer, tiles[n]);
      });
    });
  }
}

std::span<const PixelLayer> IsoLayers::at(int x, int y) const {
  const Tile& tile =
      tiles_[static_cast<size_t>(y / kTileSide) * columns_ + static_cast<size_t>(x / kTileSide)];
  if (tile.begins.empty()) return {};
  const auto pixel = static_cast<size_t>(y % kTileSide * kTileSide + x % kTileSide);
  return std::span(tile.layers).subspan(tile.begins[pixel], tile.begins[pixel + 1] - tile.begins[pixel]);
}

}  // namespace curvisplat
