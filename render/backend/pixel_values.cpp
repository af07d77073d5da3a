#include "render/backend/pixel_values.h"

#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "render/cpu/half_depths.h"
#include "render/project/footprint.h"
#include "render/project/light.h"
#include "render/tiles/splat_bins.h"
#include "render/tiles/tile_queues.h"
#include "stream/base/compute_permits.h"
#include "stream/base/threads.h"

namespace curvisplat {

glm::dvec3 placeOf(const ScreenView& view, int x, int y, double depth) {
  const double across = (x + 0.5 - 0.5 * view.size.width) / view.focal_px;
  const double down = (y + 0.5 - 0.5 * view.size.height) / view.focal_px;
  if (view.projection == Projection::kPerspective) return depth * glm::normalize(glm::dvec3(across, down, 1));
  return {across, down, depth};
}

namespace {

/// The normal of a layer's pixel, from the neighbours that are nearest in depth; 0 without neighbours.
glm::dvec3 layerNormal(const ScreenView& view, const std::vector<float>& depths, int x, int y) {
  const auto depthAt = [&](int column, int row) {
    if (column < 0 || row < 0 || column >= view.size.width || row >= view.size.height)
      return std::numeric_limits<double>::infinity();
    return double{depths[static_cast<size_t>(row) * static_cast<size_t>(view.size.width) +
                         static_cast<size_t>(column)]};
  };
  const double here = depthAt(x, y);
  const glm::dvec3 at = placeOf(view, x, y, here);
  const auto along = [&](int dx, int dy) {
    const double before = depthAt(x - dx, y - dy), after = depthAt(x + dx, y + dy);
    const int sign = std::abs(after - here) <= std::abs(before - here) ? 1 : -1;
    const double there = sign > 0 ? after : before;
    if (!std::isfinite(there)) return glm::dvec3(0.0);
    return double(sign) * (placeOf(view, x + sign * dx, y + sign * dy, there) - at);
  };
  const glm::dvec3 n = glm::cross(along(1, 0), along(0, 1));
  const double length = glm::length(n);
  return length > 0 ? n / length : glm::dvec3(0.0);
}

}  // namespace

PixelValues pixelValuesOf(const Image& painted, const ScreenView& view, double depth_origin) {
  const size_t pixels = painted.size.pixels();
  PixelValues values{painted.size, std::vector<float>(pixels), std::vector<float>(pixels),
                     std::vector<glm::vec3>(pixels, glm::vec3(0.0f))};
  for (size_t n = 0; n < pixels; ++n) {
    values.depth[n] = static_cast<float>(double{painted.rgba[4 * n]} + depth_origin);
    values.scalar[n] = painted.rgba[4 * n + 1];
  }
  for (int y = 0; y < painted.size.height; ++y)
    for (int x = 0; x < painted.size.width; ++x) {
      const size_t n =
          static_cast<size_t>(y) * static_cast<size_t>(painted.size.width) + static_cast<size_t>(x);
      if (!std::isfinite(values.depth[n])) continue;
      const double nx = painted.rgba[4 * n + 2], ny = painted.rgba[4 * n + 3];
      glm::dvec3 normal(nx, ny, -std::sqrt(std::max(0.0, 1 - nx * nx - ny * ny)));
      if (nx == kOfLayer)
        normal = layerNormal(view, values.depth, x, y);
      else if (std::isnan(nx))
        normal = glm::dvec3(0.0);
      if (glm::dot(normal, placeOf(view, x, y, 1)) > 0 && nx == kOfLayer) normal = -normal;
      values.normal[n] = glm::vec3(normal.x * view.right + normal.y * view.down + normal.z * view.forward);
    }
  return values;
}

namespace {

constexpr size_t kEntriesASplat = 4;
constexpr float kBefore = -1e30f, kHardly = 1e-5f;
constexpr float kMinOpacity = 1.0f / 510;  // of a pixel that has values

/// The values found at a tile's pixels, and the pixels' places among their layers.
struct FoundTile {
  std::array<std::array<float, 4>, HalfTile::kPixels> values;
  std::array<uint8_t, HalfTile::kPixels> layers{};  // the next
};

/// A splat with its records, unpacked.
struct UnpackedSplat {
  const ScreenSplat& splat;
  HalfSplat half{};
  std::optional<ScreenCut> cut;
  std::optional<ScreenColour> colour;
  FootprintSkew skew;
  float half_width;

  UnpackedSplat(const ScreenSplat& of, const PixelShading& shading)
      : splat(of), skew(FootprintSkew::unpack(of.skew)) {
    const SplatRecords records = SplatRecords::beside(&of, -1, shading.colours != nullptr);
    if (records.depth) half.depth = ScreenDepth::of(*records.depth);
    if (records.cut) cut = ScreenCut::of(*records.cut);
    if (records.colour) colour = ScreenColour::of(*records.colour);
    half_width = shading.lit ? unpackHalfWidth(of.half_width) : of.half_width;
    half.x = of.x;
    half.y = of.y;
    half.per_l11 = 1 / double{of.l11};
    half.l21 = of.l21;
    half.per_l22 = 1 / double{of.l22};
    half.amplitude = std::abs(of.amplitude);
    half.mean = of.mean;
    half.slope0 = shading.per_pixel ? of.slope0 : 0;
    half.slope1 = shading.per_pixel ? of.slope1 : 0;
    half.half_width = shading.per_pixel ? half_width : 0;
    half.cut = cut ? &*cut : nullptr;
    half.skew = of.skew != 0 ? &skew : nullptr;
  }
  UnpackedSplat(const UnpackedSplat&) = delete;
  UnpackedSplat& operator=(const UnpackedSplat&) = delete;
};

/// The place where a splat takes a pixel to its half: the pixel, u, and the depth.
struct Found {
  int x, y;
  double u0, u1, depth;
};

class ValuePainter final : public Painter {
 public:
  explicit ValuePainter(const ValueInputs& inputs) : inputs_(inputs) {}

  void begin(ImageSize size, const glm::vec4&, const ClassificationTable& table, PixelShading shading,
             const PaintResources& resources) override {
    size_ = size;
    extinction_.emplace(table);
    shading_ = shading;
    const Computing computing(resources.permits);
    loop_.emplace(threadsOrCores(resources.threads), resources.permits);
    bins_.emplace(size, resources.batch_splats, kEntriesASplat * resources.batch_splats, loop_->threads());
    bins_->open();
    queues_.emplace(size, resources.waiting_splats, loop_->threads());
    constexpr float kNone = std::numeric_limits<float>::infinity(),
                    kUnknown = std::numeric_limits<float>::quiet_NaN();
    halves_.assign(TileSet::tilesOf(size), {});
    found_.assign(halves_.size(), {});
    for (size_t tile = 0; tile < halves_.size(); ++tile) {
      HalfTile& half = halves_[tile];
      half.target.fill(HalfTile::kFound);
      half.next_layer.fill(std::numeric_limits<double>::infinity());
      found_[tile].values.fill({kNone, kUnknown, 0, 0});
      forPixels(tile, [&](size_t pixel, int x, int y) {
        const float opacity = inputs_.picture.pixel(x, y)[3];
        if (opacity >= kMinOpacity) half.target[pixel] = -std::log1p(-0.5 * double{opacity});
        if (!inputs_.layers || inputs_.layers->at(x, y).empty()) return;
        half.next_layer[pixel] = inputs_.layers->at(x, y).front().depth;
      });
    }
  }

  void drawOnly(const TileSet& tiles) override {
    paintBatch(true);
    for (size_t number = 0; number < TileSet::tilesOf(size_); ++number)
      if (tiles.hasAnyOf(number))
        bins_->open(static_cast<int>(number));
      else
        bins_->close(static_cast<int>(number));
  }

  void draw(std::span<const ScreenSplat> splats) override {
    const Computing computing(loop_->permits());
    while (!splats.empty()) {
      splats = splats.subspan(bins_->add(splats));
      if (!splats.empty()) paintBatch(false);
    }
  }

  Image end() override {
    const Computing computing(loop_->permits());
    paintBatch(true);
    Image image(size_);
    for (size_t tile = 0; tile < halves_.size(); ++tile)
      forPixels(tile, [&](size_t pixel, int x, int y) {
        if (halves_[tile].target[pixel] != HalfTile::kFound)
          passLayers(tile, pixel, x, y, std::numeric_limits<double>::infinity());
        std::copy_n(found_[tile].values[pixel].data(), 4, image.pixel(x, y));
      });
    return image;
  }

  double uploadSeconds() const override { return 0; }
  double drawSeconds() const override { return 0; }
  bool isOverfull() const override { return queues_->isFull(); }

 private:
  glm::ivec2 firstOf(size_t tile) const {
    const auto columns = static_cast<size_t>(TileSet::tilesAlong(size_.width));
    return {static_cast<int>(tile % columns) * kTileSide, static_cast<int>(tile / columns) * kTileSide};
  }
  /// visit(number in the tile, x, y)
  template <typename Visit>
  void forPixels(size_t tile, const Visit& visit) const {
    const glm::ivec2 first = firstOf(tile);
    for (int y = 0; y < std::min(kTileSide, size_.height - first.y); ++y)
      for (int x = 0; x < std::min(kTileSide, size_.width - first.x); ++x)
        visit(static_cast<size_t>(y * kTileSide + x), first.x + x, first.y + y);
  }

  /// `last`: no more splats will come for any tile.
  void paintBatch(bool last) {
    bins_->sort(*loop_);
    const uint32_t front = bins_->empty() ? 0 : bins_->splats().back().first;
    loop_->forAll("find depths", TileSet::tilesOf(size_), 1, [&, this](size_t number) {
      const auto entries = bins_->tile(static_cast<int>(number));
      if (entries.empty() && !(last && queues_->waits(number))) return;
      queues_->paint(number, {bins_->splats(), entries, front, last}, TileQueues::kAllOpen,
                     [&, this](const OrderedTile& ordered) { return paintTile(number, ordered); });
    });
    bins_->clear();
  }

  /// Returns which order tiles can still change.
  uint64_t paintTile(size_t number, const OrderedTile& ordered) {
    const glm::ivec2 first = firstOf(number);
    if (!ordered.lists) {
      const HalfBox all = {
          first.x, first.y, first.x, first.y, first.x + kTileSide - 1, first.y + kTileSide - 1};
      for (const uint32_t n : ordered.order) addSplat(number, ordered.splats[n], all);
    } else {
      for (size_t tile = 0; tile < kOrderTiles; ++tile) {
        const int x = first.x + static_cast<int>(tile) % kOrderTilesAlong * kOrderSide,
                  y = first.y + static_cast<int>(tile) / kOrderTilesAlong * kOrderSide;
        for (const uint64_t item : (*ordered.lists)[tile])
          addSplat(number, ordered.splats[ordered.order[numberOf(item)]],
                   {first.x, first.y, x, y, x + kOrderSide - 1, y + kOrderSide - 1});
      }
    }
    const HalfTile& half = halves_[number];
    const bool all_found = std::all_of(half.target.begin(), half.target.end(),
                                       [](double target) { return target == HalfTile::kFound; });
    if (all_found) bins_->close(static_cast<int>(number));
    return all_found ? 0 : TileQueues::kAllOpen;
  }

  /// Adds a splat to those of its pixels that lie in the box.
  void addSplat(size_t number, const ScreenSplat& s, HalfBox box) {
    const UnpackedSplat splat(s, shading_);
    constexpr double kSupport = kKernelSupport;
    const double reach_x = kSupport * s.l11, reach_y = kSupport * std::hypot(s.l21, s.l22);
    const auto from = [](int least, double at) {
      return std::max(least, static_cast<int>(std::ceil(std::max(at, -1.0))));
    };
    const auto to = [](int last, double at) {
      return static_cast<int>(std::min<double>(last, std::max(at, -1.0)));
    };
    box = {box.tile_x,
           box.tile_y,
           from(box.x0, s.x - reach_x - 0.5),
           from(box.y0, s.y - reach_y - 0.5),
           to(std::min(box.x1, size_.width - 1), s.x + reach_x - 0.5),
           to(std::min(box.y1, size_.height - 1), s.y + reach_y - 0.5)};
    if (box.x0 > box.x1 || box.y0 > box.y1) return;
    Events events(*this, number, splat);
    addToHalf(splat.half, box, *extinction_, halves_[number], events);
  }

  /// The events of one splat in one tile.
  class Events final : public HalfEvents {
   public:
    Events(ValuePainter& painter, size_t tile, const UnpackedSplat& splat)
        : painter_(painter), tile_(tile), splat_(splat) {}

    void passLayers(size_t pixel, double distance) override {
      const glm::ivec2 at = placeOf(pixel);
      painter_.passLayers(tile_, pixel, at.x, at.y, distance);
    }
    void reach(size_t pixel, double part) override {
      const ScreenDepth& depth = splat_.half.depth;
      const glm::ivec2 at = placeOf(pixel);
      const double u0 = (at.x + 0.5 - splat_.half.x) * splat_.half.per_l11;
      const double u1 = (at.y + 0.5 - splat_.half.y - splat_.half.l21 * u0) * splat_.half.per_l22;
      const double z = depth.middle + depth.by[0] * u0 + depth.by[1] * u1;
      // The place within the splat, whose depths are taken to be uniform with their deviation.
      const double behind = (2 * std::clamp(part, 0.0, 1.0) - 1) * std::numbers::sqrt3 / depth.per_depth;
      painter_.halves_[tile_].target[pixel] = HalfTile::kFound;
      painter_.take(splat_, painter_.found_[tile_].values[pixel], {at.x, at.y, u0, u1, z + behind});
    }

   private:
    glm::ivec2 placeOf(size_t pixel) const {
      return painter_.firstOf(tile_) +
             glm::ivec2(static_cast<int>(pixel) % kTileSide, static_cast<int>(pixel) / kTileSide);
    }

    ValuePainter& painter_;
    const size_t tile_;
    const UnpackedSplat& splat_;
  };

  /// How the scalar changes at one depth, per pixel, and along the ray. The record's numbers are of a screen with the
  /// low-pass; with q the depth's change in the frame of A and S2' = S2 + low-pass, it has S2'⁻¹ B q, and from its
  /// deviation |q|² is known: so is what they would be without.
  glm::dvec3 gradientOf(const UnpackedSplat& of, const ScreenSplat& s) const {
    constexpr double kMinHidden = 1e-12;
    const double l11 = s.l11, l21 = s.l21, l22 = s.l22;
    const auto perPixel = [&](double by0, double by1) {
      return glm::dvec2(by0 / l11 - by1 * l21 / (l11 * l22), by1 / l22);
    };
    const glm::dmat2 passed(l11 * l11, l11 * l21, l11 * l21, l21 * l21 + l22 * l22);
    const glm::dmat2 shape = passed - glm::dmat2(inputs_.view.low_pass_px2 - inputs_.view.slope_low_pass_px2);
    const glm::dvec2 depth = perPixel(of.half.depth.by[0], of.half.depth.by[1]), bq = passed * depth;
    const double sigma_per_depth = kKernelSigma * of.half.depth.per_depth,
                 hidden = 1 / (sigma_per_depth * sigma_per_depth);
    const double q2 = hidden + glm::dot(depth, bq);
    const double least = kMinHidden * q2;
    const double determinant = glm::determinant(shape);
    const glm::dvec2 by = determinant > 0 ? glm::inverse(shape) * bq : depth;
    const double own = std::max(q2 - glm::dot(by, bq), least);
    const double along = of.half.depth.correlation * of.half_width / (std::numbers::sqrt3 * kKernelSigma);
    const double ratio = determinant > 0 ? glm::determinant(passed) / determinant : 1;
    const double per_depth = along * std::sqrt(ratio * hidden) / own;
    return {perPixel(s.slope0, s.slope1) - per_depth * by, per_depth};
  }

  /// Columns: how a point in view axes moves from pixel to pixel at one depth, and along the ray.
  glm::dmat3 placeSlopes(int x, int y, double depth) const {
    const ScreenView& view = inputs_.view;
    const double pixel = 1 / view.focal_px;
    if (view.projection == Projection::kOrthographic) return {pixel, 0, 0, 0, pixel, 0, 0, 0, 1};
    const glm::dvec3 ray((x + 0.5 - 0.5 * view.size.width) * pixel,
                         (y + 0.5 - 0.5 * view.size.height) * pixel, 1);
    const double length = glm::length(ray);
    const glm::dvec3 along = ray / length;
    const auto across = [&](const glm::dvec3& step) {
      return depth * pixel / length * (step - glm::dot(step, along) * along);
    };
    return {across({1, 0, 0}), across({0, 1, 0}), along};
  }

  void take(const UnpackedSplat& of, std::array<float, 4>& values, const Found& found) const {
    const auto [x, y, u0, u1, z] = found;
    const ScreenSplat& s = of.splat;
    double f = s.mean + s.slope0 * u0 + s.slope1 * u1;
    if (of.colour) f = of.colour->mean + of.colour->slope[0] * u0 + of.colour->slope[1] * u1;
    const glm::dvec3 gradient = gradientOf(of, s);
    glm::dvec3 n = glm::inverse(glm::transpose(placeSlopes(x, y, z))) * gradient;
    const double length = glm::length(n);
    n = length > 0 && std::isfinite(length) ? n / length
                                            : glm::dvec3(std::numeric_limits<double>::quiet_NaN());
    if (n.z > 0) n = -n;
    values = {static_cast<float>(z), static_cast<float>(f), static_cast<float>(n.x), static_cast<float>(n.y)};
  }

  /// The layers of a pixel that is not found, nearer than `distance`.
  void passLayers(size_t tile, size_t pixel, int x, int y, double distance) {
    if (!inputs_.layers) return;
    const auto layers = inputs_.layers->at(x, y);
    HalfTile& half = halves_[tile];
    uint8_t& next = found_[tile].layers[pixel];
    for (; next < layers.size() && double{layers[next].depth} < distance; ++next) {
      const PixelLayer& layer = layers[next];
      half.depth[pixel] -= std::log1p(-double{layer.colour.w});
      if (half.depth[pixel] < half.target[pixel]) continue;
      half.target[pixel] = HalfTile::kFound;
      found_[tile].values[pixel] = {layer.depth, layer.scalar, kOfLayer, kOfLayer};
      return;
    }
    half.next_layer[pixel] =
        next < layers.size() ? double{layers[next].depth} : std::numeric_limits<double>::infinity();
  }

  const ValueInputs inputs_;
  ImageSize size_{0, 0};
  std::optional<MeanExtinction> extinction_;
  PixelShading shading_;
  std::optional<SplatBins> bins_;
  std::optional<TileQueues> queues_;
  std::optional<PaintLoop> loop_;
  std::vector<HalfTile> halves_;  // [tiles]
  std::vector<FoundTile> found_;  // [tiles]
};

class ValueBackend final : public PaintingBackend {
 public:
  explicit ValueBackend(const ValueInputs& inputs) : painter_(inputs) {}

  void run(const Job& job) override { job(painter_); }
  const std::string& name() const override { return name_; }
  bool isSoftware() const override { return true; }
  uint64_t bytes(ImageSize size, const PaintResources& resources) const override {
    return valueBytes(size, resources);
  }

 private:
  ValuePainter painter_;
  const std::string name_ = "values, on the processor";
};

}  // namespace

PixelLayers everywhere(ImageSize size, double depth_origin) {
  std::vector<PixelLayers::Row> rows(static_cast<size_t>(size.height));
  for (PixelLayers::Row& row : rows)
    for (int x = 0; x < size.width; ++x) {
      row.layers.push_back({kBefore, glm::vec4(0, 0, 0, kHardly)});
      row.endPixel(row.layers.size() - 1);
    }
  return {size, std::move(rows), depth_origin};
}

uint64_t valueBytes(ImageSize size, const PaintResources& resources) {
  constexpr uint64_t kLayer = sizeof(PixelLayer) + sizeof(uint32_t);  // everywhere()'s
  return TileSet::tilesOf(size) * (sizeof(HalfTile) + sizeof(FoundTile)) + size.pixels() * kLayer +
         SplatBins::bytes(size, resources.batch_splats, kEntriesASplat * resources.batch_splats,
                          threadsOrCores(resources.threads)) +
         TileQueues::bytes(size, resources.waiting_splats, threadsOrCores(resources.threads));
}

std::unique_ptr<PaintingBackend> makeValueBackend(const ValueInputs& inputs) {
  return std::make_unique<ValueBackend>(inputs);
}

}  // namespace curvisplat
