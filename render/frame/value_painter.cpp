#include "render/frame/value_painter.h"

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <thread>
#include <vector>

#include "render/cpu/splat_bins.h"
#include "render/cpu/tile.h"
#include "render/frame/pixel_values.h"
#include "render/project/footprint_skew.h"
#include "render/project/kernel.h"
#include "render/project/light.h"

namespace curvisplat {
namespace {

constexpr int kFootprintSteps = 1024;
constexpr size_t kEntriesASplat = 4;
constexpr float kBefore = -1e30f, kHardly = 1e-5f;
constexpr float kMinOpacity = 1.0f / 510;  // of a pixel that has values

/// One pixel on its way to the half of its opacity.
struct Halfway {
  float through = 1;  // so far
  float target = 0;   // what comes through at the half
  uint8_t layer = 0;  // the next
  bool found = false;
  float values[4] = {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN(), 0, 0};
};

/// The share of the biweight's distribution below x deviations.
double shareBelow(double x) {
  const double y = std::clamp(x / std::sqrt(7.0), -1.0, 1.0), y2 = y * y;
  return 0.5 + y * (0.9375 - 0.625 * y2 + 0.1875 * y2 * y2);
}

/// The extinction of ClassificationTable::mean() alone: a quarter of its work.
class MeanExtinction {
 public:
  explicit MeanExtinction(const ClassificationTable& table)
      : log_scale_(table.logScale()),
        scale_(table.scale()),
        bias_(table.bias()),
        below_(table.below().w),
        above_(table.above().w) {
    for (const glm::dvec4& until : table.exactCumulative()) cumulative_.push_back(until.w);
  }

  double over(double centre, double half_width) const {
    double from = inCells(centre - half_width), to = inCells(centre + half_width);
    if (to - from < 1) {
      const double middle = 0.5 * (from + to);
      from = middle - 0.5;
      to = middle + 0.5;
    }
    return std::max(0.0, (until(to) - until(from)) / (to - from));
  }

 private:
  double inCells(double scalar) const {
    constexpr double kLeast = ClassificationTable::kMinLogarithmic;
    return scale_ * (log_scale_ ? std::log(std::max(scalar, kLeast)) : scalar) + bias_;
  }
  double until(double x) const {
    constexpr int kCells = ClassificationTable::kCells;
    if (x <= 0) return below_ * x;
    if (x >= kCells) return cumulative_.back() + above_ * (x - kCells);
    const auto cell = static_cast<size_t>(x);
    return cumulative_[cell] + (x - static_cast<double>(cell)) * (cumulative_[cell + 1] - cumulative_[cell]);
  }

  bool log_scale_;
  double scale_, bias_, below_, above_;
  std::vector<double> cumulative_;
};

/// A splat with its records, unpacked.
struct UnpackedSplat {
  const ScreenSplat& splat;
  ScreenDepth depth;
  std::optional<ScreenCut> cut;
  std::optional<ScreenColour> colour;
  FootprintSkew skew;
  float half_width;
  double per_l11, per_l22;

  UnpackedSplat(const ScreenSplat& of, bool coloured, bool lit)
      : splat(of), skew(FootprintSkew::unpack(of.skew)) {
    const SplatRecords records = SplatRecords::beside(&of, -1, coloured);
    if (records.depth) depth = ScreenDepth::of(*records.depth);
    if (records.cut) cut = ScreenCut::of(*records.cut);
    if (records.colour) colour = ScreenColour::of(*records.colour);
    half_width = lit ? unpackHalfWidth(of.half_width) : of.half_width;
    per_l11 = 1 / double{of.l11};
    per_l22 = 1 / double{of.l22};
  }

  /// How much of the splat its faces leave at u.
  double shareAt(double u0, double u1) const {
    if (!cut) return 1;
    double lo = -ScreenCut::kReach, hi = ScreenCut::kReach;
    for (size_t n = 0; n < ScreenCut::kFaces; ++n) {
      const double a = cut->faces[n][0] + cut->faces[n][1] * u0 + cut->faces[n][2] * u1;
      if (cut->far_sides >> n & 1)
        lo = std::max(lo, -a);
      else
        hi = std::min(hi, a);
    }
    return std::max(0.0, shareBelow(hi) - shareBelow(lo));
  }
};

/// Where a splat takes a pixel to its half: the pixel, u, and the depth.
struct Found {
  int x, y;
  double u0, u1, depth;
};

class ValuePainter final : public Painter {
 public:
  explicit ValuePainter(const ValueInputs& inputs) : inputs_(inputs) {
    for (const double f : footprintTable(kFootprintSteps)) footprint_.push_back(f);
  }

  DrawingOrder order() const override { return DrawingOrder::kFrontToBack; }

  void begin(ImageSize size, const glm::vec4&, const ClassificationTable& table, PixelShading shading,
             const PaintResources& resources) override {
    size_ = size;
    extinction_.emplace(table);
    shading_ = shading;
    const unsigned threads =
        resources.threads ? resources.threads : std::max(1u, std::thread::hardware_concurrency());
    bins_.emplace(size, resources.batch_splats, kEntriesASplat * resources.batch_splats, threads);
    bins_->open();
    arena_.emplace(std::min(static_cast<int>(threads), tbb::info::default_concurrency()));
    pixels_.assign(size.pixels(), {});
    for (size_t n = 0; n < pixels_.size(); ++n) {
      const float opacity = inputs_.picture.rgba[4 * n + 3];
      pixels_[n].found = opacity < kMinOpacity;
      pixels_[n].target = 1 - 0.5f * opacity;
    }
  }

  void drawOnly(const TileSet& tiles) override {
    if (!bins_->empty()) paintBatch();
    for (size_t number = 0; number < TileSet::tilesOf(size_); ++number)
      if (tiles.has(number))
        bins_->open(static_cast<int>(number));
      else
        bins_->close(static_cast<int>(number));
  }

  void draw(std::span<const ScreenSplat> splats) override {
    while (!splats.empty()) {
      splats = splats.subspan(bins_->add(splats));
      if (!splats.empty()) paintBatch();
    }
  }

  Image end() override {
    if (!bins_->empty()) paintBatch();
    Image image(size_);
    for (int y = 0; y < size_.height; ++y)
      for (int x = 0; x < size_.width; ++x) {
        Halfway& pixel = at(x, y);
        if (!pixel.found) passLayers(pixel, x, y, std::numeric_limits<float>::infinity());
        std::copy_n(pixel.values, 4, image.pixel(x, y));
      }
    return image;
  }

  double uploadSeconds() const override { return 0; }
  double drawSeconds() const override { return 0; }

 private:
  Halfway& at(int x, int y) {
    return pixels_[static_cast<size_t>(y) * static_cast<size_t>(size_.width) + static_cast<size_t>(x)];
  }

  void paintBatch() {
    arena_->execute([this] {
      bins_->sort();
      tbb::parallel_for(size_t{0}, TileSet::tilesOf(size_), [this](size_t number) { paintTile(number); });
    });
    bins_->clear();
  }

  void paintTile(size_t number) {
    const auto order = bins_->tile(static_cast<int>(number));
    if (order.empty()) return;
    const auto columns = static_cast<size_t>(bins_->columns());
    const int x0 = static_cast<int>(number % columns) * kTileSide;
    const int y0 = static_cast<int>(number / columns) * kTileSide;
    const int x1 = std::min(x0 + kTileSide, size_.width), y1 = std::min(y0 + kTileSide, size_.height);
    for (const uint32_t n : order) {
      const UnpackedSplat splat(bins_->splats()[n], shading_.colours != nullptr, shading_.lit);
      constexpr double kSupport = kKernelSupport;
      const ScreenSplat& s = splat.splat;
      const double reach_x = kSupport * s.l11, reach_y = kSupport * std::hypot(s.l21, s.l22);
      const int from_x = std::max(x0, static_cast<int>(std::ceil(std::max(s.x - reach_x - 0.5, -1.0))));
      const int from_y = std::max(y0, static_cast<int>(std::ceil(std::max(s.y - reach_y - 0.5, -1.0))));
      const double to_x = std::min<double>(x1 - 1, s.x + reach_x - 0.5),
                   to_y = std::min<double>(y1 - 1, s.y + reach_y - 0.5);
      for (int y = from_y; y <= to_y; ++y)
        for (int x = from_x; x <= to_x; ++x)
          if (Halfway& pixel = at(x, y); !pixel.found) paintPixel(splat, pixel, x, y);
    }
    bool open = false;
    for (int y = y0; y < y1 && !open; ++y)
      for (int x = x0; x < x1 && !open; ++x) open = !at(x, y).found;
    if (!open) bins_->close(static_cast<int>(number));
  }

  void paintPixel(const UnpackedSplat& of, Halfway& pixel, int x, int y) const {
    const ScreenSplat& s = of.splat;
    const double u0 = (x + 0.5 - s.x) * of.per_l11, u1 = (y + 0.5 - s.y - s.l21 * u0) * of.per_l22;
    const double rho2 = u0 * u0 + u1 * u1;
    if (!(rho2 < kKernelSupport * kKernelSupport)) return;
    const double step = rho2 * (kFootprintSteps / (kKernelSupport * kKernelSupport));
    const auto cell = static_cast<size_t>(step);
    double depth =
        std::abs(s.amplitude) *
        (footprint_[cell] + (step - static_cast<double>(cell)) * (footprint_[cell + 1] - footprint_[cell])) *
        of.shareAt(u0, u1);
    if (s.skew != 0) depth *= of.skew.at(u0, u1);
    if (!(depth > 0)) return;
    const double f = s.mean + (shading_.per_pixel ? double{s.slope0} * u0 + double{s.slope1} * u1 : 0);
    const double extinction = extinction_->over(f, shading_.per_pixel ? double{of.half_width} : 0);
    if (!(extinction > 0)) return;
    const double z = of.depth.middle + of.depth.by[0] * u0 + of.depth.by[1] * u1;
    passLayers(pixel, x, y, static_cast<float>(z));
    if (pixel.found) return;
    const float after = pixel.through * std::exp(static_cast<float>(-depth * extinction));
    if (after <= pixel.target) {
      // Where in the splat: its depths are taken for a uniform distribution of their deviation.
      const double part = std::log(pixel.through / pixel.target) / (depth * extinction);
      take(of, pixel,
           {x, y, u0, u1,
            z + (2 * std::clamp(part, 0.0, 1.0) - 1) * std::numbers::sqrt3 / of.depth.per_depth});
    }
    pixel.through = after;
  }

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
    const glm::dvec2 depth = perPixel(of.depth.by[0], of.depth.by[1]), bq = passed * depth;
    const double sigma_per_depth = kKernelSigma * of.depth.per_depth,
                 hidden = 1 / (sigma_per_depth * sigma_per_depth);
    const double q2 = hidden + glm::dot(depth, bq);
    const double least = kMinHidden * q2;
    const double determinant = glm::determinant(shape);
    const glm::dvec2 by = determinant > 0 ? glm::inverse(shape) * bq : depth;
    const double own = std::max(q2 - glm::dot(by, bq), least);
    const double along = of.depth.correlation * of.half_width / (std::numbers::sqrt3 * kKernelSigma);
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

  void take(const UnpackedSplat& of, Halfway& pixel, const Found& found) const {
    const auto [x, y, u0, u1, z] = found;
    const ScreenSplat& s = of.splat;
    pixel.found = true;
    double f = s.mean + s.slope0 * u0 + s.slope1 * u1;
    if (of.colour) f = of.colour->mean + of.colour->slope[0] * u0 + of.colour->slope[1] * u1;
    const glm::dvec3 gradient = gradientOf(of, s);
    glm::dvec3 n = glm::inverse(glm::transpose(placeSlopes(x, y, z))) * gradient;
    const double length = glm::length(n);
    n = length > 0 && std::isfinite(length) ? n / length
                                            : glm::dvec3(std::numeric_limits<double>::quiet_NaN());
    if (n.z > 0) n = -n;
    const double values[4] = {z, f, n.x, n.y};
    for (int c = 0; c < 4; ++c) pixel.values[c] = static_cast<float>(values[c]);
  }

  /// The layers nearer than `depth`.
  void passLayers(Halfway& pixel, int x, int y, float depth) const {
    if (!inputs_.layers) return;
    const auto layers = inputs_.layers->at(x, y);
    for (; pixel.layer < layers.size() && layers[pixel.layer].depth < depth && !pixel.found; ++pixel.layer) {
      const PixelLayer& layer = layers[pixel.layer];
      pixel.through *= 1 - layer.colour.w;
      if (pixel.through > pixel.target) continue;
      pixel.found = true;
      const float values[4] = {layer.depth, layer.scalar, kOfLayer, kOfLayer};
      std::copy_n(values, 4, pixel.values);
    }
  }

  const ValueInputs inputs_;
  std::vector<double> footprint_;
  ImageSize size_{0, 0};
  std::optional<MeanExtinction> extinction_;
  PixelShading shading_;
  std::optional<SplatBins> bins_;
  std::optional<tbb::task_arena> arena_;
  std::vector<Halfway> pixels_;
};

class ValueBackend final : public PaintingBackend {
 public:
  explicit ValueBackend(const ValueInputs& inputs) : painter_(inputs) {}

  void run(const Job& job) override { job(painter_); }
  DrawingOrder order() const override { return painter_.order(); }
  const std::string& name() const override { return name_; }
  bool isSoftware() const override { return true; }
  uint64_t bytes(ImageSize size, const PaintResources& resources) const override {
    const unsigned threads =
        resources.threads ? resources.threads : std::max(1u, std::thread::hardware_concurrency());
    constexpr uint64_t kLayer = sizeof(PixelLayer) + sizeof(uint32_t);  // everywhere()'s
    return size.pixels() * (sizeof(Halfway) + kLayer) +
           SplatBins::bytes(size, resources.batch_splats, kEntriesASplat * resources.batch_splats, threads);
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

std::unique_ptr<PaintingBackend> makeValueBackend(const ValueInputs& inputs) {
  return std::make_unique<ValueBackend>(inputs);
}

}  // namespace curvisplat
