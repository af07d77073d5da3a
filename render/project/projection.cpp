#include "render/project/projection.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/project/border_parts.h"
#include "render/project/clip_planes.h"
#include "render/project/face_cut.h"
#include "render/project/kernel.h"
#include "render/project/light.h"
#include "render/project/splat_cutter.h"
#include "render/project/splat_ellipse.h"
#include "render/project/splat_maps.h"
#include "stream/base/check.h"
#include "stream/model/border_code.h"

namespace curvisplat {
namespace {

constexpr size_t kBlock = 256;  // splats at a time: the arrays between the two loops stay in the L1 cache
constexpr auto kSupport = static_cast<float>(kKernelSupport);

/// What the arithmetic loop hands to the loop that chooses.
struct Block {
  float x[kBlock], y[kBlock], depth[kBlock];
  float l11[kBlock], l21[kBlock], l22[kBlock];
  float amplitude[kBlock];
  float slope0[kBlock], slope1[kBlock], half_width[kBlock];
  int32_t too_wide[kBlock];  // perspective: to be cut up, or before the near plane

  [[gnu::always_inline]] void set(size_t n, const Ellipse& ellipse) {
    l11[n] = ellipse.l11;
    l21[n] = ellipse.l21;
    l22[n] = ellipse.l22;
    amplitude[n] = ellipse.amplitude;
    slope0[n] = ellipse.slope0;
    slope1[n] = ellipse.slope1;
    half_width[n] = ellipse.half_width;
  }
};

ScreenSplat screenSplat(float x, float y, const Ellipse& e, float mean) {
  return {x, y, e.l11, e.l21, e.l22, e.amplitude, mean, e.slope0, e.slope1, e.half_width};
}

void computeBlock(const OrthographicMap& map, const GeometryArrays<const float>& geometry,
                  const VariableArrays<const float>& variable, size_t begin, size_t count, Block& block) {
#pragma GCC ivdep
  for (size_t n = 0; n < count; ++n) {
    const size_t i = begin + n;
    const float x = geometry.x[i], y = geometry.y[i], z = geometry.z[i];
    block.x[n] = map.x + map.rows.x0 * x + map.rows.y0 * y + map.rows.z0 * z;
    block.y[n] = map.y + map.rows.x1 * x + map.rows.y1 * y + map.rows.z1 * z;
    block.depth[n] = map.depth.x * x + map.depth.y * y + map.depth.z * z;
    block.too_wide[n] = 0;
    block.set(n, ellipseOf(map.rows, shapeOf(geometry, i), slopeOf(variable, i), variable.variance[i],
                           geometry.weight[i] * map.volume, map.low_pass_px2, map.slope_low_pass_px2));
  }
}

void computeBlock(const PerspectiveMap& map, const GeometryArrays<const float>& geometry,
                  const VariableArrays<const float>& variable, size_t begin, size_t count, Block& block) {
#pragma GCC ivdep
  for (size_t n = 0; n < count; ++n) {
    const size_t i = begin + n;
    const float x = geometry.x[i], y = geometry.y[i], z = geometry.z[i];
    const PerspectiveMap::Centre centre = map.centreOf(x, y, z);
    const Shape shape = shapeOf(geometry, i);
    block.x[n] = map.pixelX(centre);
    block.y[n] = map.pixelY(centre);
    block.depth[n] = centre.distance;
    block.too_wide[n] = map.tooWide(centre, map.radiusOf(shape));
    block.set(n,
              ellipseOf(map.rowsAt(centre), shape, slopeOf(variable, i), variable.variance[i],
                        geometry.weight[i] * map.volumeAt(centre), map.low_pass_px2, map.slope_low_pass_px2));
  }
}

/// Decides about one projected splat after the other, and keeps what can be seen.
class Chooser {
 public:
  enum class Fate { kOffScreen, kTransparent, kKept };

  Chooser(const ProjectionSettings& settings, const ClassificationTable& table,
          std::vector<ScreenSplat>& splats, std::vector<float>& depths)
      : table_(table),
        width_(static_cast<float>(settings.view.size.width)),
        height_(static_cast<float>(settings.view.size.height)),
        reach_(1.001f * static_cast<float>(largestReach(settings.view.low_pass_px2))),
        largest_scalar_(kLargestCells /
                        std::max(table.logScale() ? 1.0f : std::abs(table.scale()), kMinScale)),
        per_pixel_(settings.per_pixel),
        lit_(settings.light.has_value()),
        splats_(splats),
        depths_(depths) {}

  /// Inline: handed over through memory, a splat that has just been put together stalls on its way into the
  /// vector, which takes as long as all the rest. `widening`: how much farther than half_width a mean can be.
  [[gnu::always_inline]] Fate choose(ScreenSplat splat, float depth, const Lit& lit, float widening = 1) {
    const float reach_x = kSupport * splat.l11;
    const float reach_y = kSupport * (std::abs(splat.l21) + splat.l22);
    const bool on_screen = splat.x + reach_x > 0 && splat.x - reach_x < width_ && splat.y + reach_y > 0 &&
                           splat.y - reach_y < height_;
    if (!on_screen) return Fate::kOffScreen;
    if (!per_pixel_) splat.slope0 = splat.slope1 = splat.half_width = 0;
    float spread = kSupport * (std::abs(splat.slope0) + std::abs(splat.slope1)) + widening * splat.half_width;
    if (!(std::abs(splat.mean) + spread <= largest_scalar_)) {
      splat.slope0 = splat.slope1 = splat.half_width = spread = 0;
      splat.mean = std::clamp(splat.mean, -largest_scalar_, largest_scalar_);
    }
    splat.amplitude = std::min(splat.amplitude, kLargestAmplitude);
    if (!(splat.amplitude > 0) || table_.fullyTransparent(splat.mean - spread, splat.mean + spread))
      return Fate::kTransparent;
    if (lit_) splat.half_width = packLit(splat.half_width, lit);
    splats_.push_back(splat);
    depths_.push_back(depth);
    return Fate::kKept;
  }

  /// Of a splat that is cut. Twice as many records as splats.
  Fate chooseCut(const ScreenSplat& splat, float depth, const Lit& lit, const ScreenCut& cut) {
    const size_t before = splats_.size();
    // A truncated distribution's mean moves by up to kReach deviations; half_width is √3.
    const Fate fate = choose(splat, depth, lit, ScreenCut::kReach / std::numbers::sqrt3_v<float>);
    if (splats_.size() == before) return fate;
    ScreenSplat kept = splats_.back();
    kept.amplitude = -kept.amplitude;
    splats_.push_back(kept);
    splats_[before] = cut.record();
    depths_.push_back(depth);
    return fate;
  }

  /// Whether no piece of a splat could be seen, wherever it is. `slope`: as it is drawn.
  bool transparentThroughout(float mean, float slope, float variance) const {
    const float spread = reach_ * slope + ScreenCut::kReach * std::sqrt(slope * slope + variance);
    return table_.fullyTransparent(mean - spread, mean + spread);
  }

 private:
  // Painters find a scalar's place in the table, and depths, in float: beyond these there are infinities, and
  // infinity minus infinity is no number. Such a splat is drawn flat, and far outside of the table.
  static constexpr float kLargestCells = 1e30f, kMinScale = 1e-7f, kLargestAmplitude = 1e30f;

  const ClassificationTable& table_;
  const float width_, height_;
  const float reach_;
  const float largest_scalar_;
  const bool per_pixel_, lit_;
  std::vector<ScreenSplat>& splats_;
  std::vector<float>& depths_;
};

/// What parts and cutting may still give for a brick: pieces that are drawn, and looks at any.
struct CutBudget {
  size_t pieces = BrickProjector::kMaxPieces;
  size_t looks = 16 * BrickProjector::kMaxPieces;
};

/// Where a piece lies, and the map that is linear there.
struct PlacedPiece {
  float x, y, depth, volume;
  ScreenRows rows;
};

/// Calls take(piece, its place) for what is to be drawn of `piece`; false as soon as take() gives it, or
/// after more `looks` at pieces, which it counts down.
template <typename Take>
bool place(const OrthographicMap& map, const SplatPiece& piece, size_t&, const Take& take) {
  const float x = piece.position.x, y = piece.position.y, z = piece.position.z;
  return take(piece, PlacedPiece{map.x + map.rows.x0 * x + map.rows.y0 * y + map.rows.z0 * z,
                                 map.y + map.rows.x1 * x + map.rows.y1 * y + map.rows.z1 * z,
                                 map.depth.x * x + map.depth.y * y + map.depth.z * z, map.volume, map.rows});
}
template <typename Take>
bool place(const PerspectiveMap& map, const SplatPiece& piece, size_t& looks, const Take& take) {
  return cutUp(map, piece, looks, [&](const SplatPiece& part, const PerspectiveMap::Centre& centre) {
    return take(part, PlacedPiece{map.pixelX(centre), map.pixelY(centre), centre.distance,
                                  map.volumeAt(centre), map.rowsAt(centre)});
  });
}

/// Takes splat `i` to the parts and pieces that it is drawn as, and chooses among them: the best fate of any.
/// Nothing if that takes more than what is `left`, which it counts down.
template <typename Map>
std::optional<Chooser::Fate> choosePieces(const Map& map, const GeometryArrays<const float>& geometry,
                                          const VariableArrays<const float>& variable, size_t i,
                                          uint32_t border_code, const BorderStyle* borders,
                                          const LocalClipPlanes* clip, const Lit& lit, Chooser& chooser,
                                          CutBudget& left) {
  const SplatPiece whole{{geometry.x[i], geometry.y[i], geometry.z[i]},
                         shapeOf(geometry, i),
                         slopeOf(variable, i),
                         variable.mean[i],
                         geometry.weight[i]};
  const glm::dvec3 slope(whole.slope.w0, whole.slope.w1, whole.slope.w2);
  if (chooser.transparentThroughout(whole.mean, static_cast<float>(drawnSlope(slope, border_code)),
                                    variable.variance[i]))
    return Chooser::Fate::kTransparent;
  auto best = Chooser::Fate::kOffScreen;
  // A splat that is cut at faces has a record of its own, as any splat; what it takes beyond that counts.
  size_t own = clip || inwardAxes(border_code).faces != 0 ? 1 : 0;
  const auto take = [&](const SplatPiece& piece, const PlacedPiece& at) {
    if (left.pieces + own == 0) return false;
    const Ellipse ellipse = ellipseOf(at.rows, piece.shape, piece.slope, variable.variance[i],
                                      piece.weight * at.volume, map.low_pass_px2, map.slope_low_pass_px2);
    const ScreenSplat splat = screenSplat(at.x, at.y, ellipse, piece.mean);
    ScreenCut cut;
    const Remains remains = cutAtFaces(at.rows, piece, ellipse, map.low_pass_px2, cut);
    if (remains == Remains::kNothing) return true;
    const size_t records = remains == Remains::kAll ? 1 : 2;
    if (left.pieces + own < records) return false;
    const auto fate = remains == Remains::kAll ? chooser.choose(splat, at.depth, lit)
                                               : chooser.chooseCut(splat, at.depth, lit, cut);
    if (fate == Chooser::Fate::kKept) {
      left.pieces -= records - own;
      own = 0;
    }
    best = std::max(best, fate);
    return true;
  };
  BorderPieces parts;
  size_t count = 1;
  if (border_code == kNoBorder)
    parts[0] = whole;
  else
    count = partsAtBorder(whole, border_code, *borders, parts);
  for (size_t n = 0; n < count; ++n) {
    if (clip) clip->addFaces(parts[n]);
    if (!place(map, parts[n], left.looks, take)) return {};
  }
  return best;
}

/// False if the brick would take more than what is `left`, which it counts down. Cells at borders are drawn
/// in this style; if it is null, they are drawn as any cell, and clip planes do not cut.
template <typename Map>
bool projectRange(const Map& map, const BorderStyle* borders, const LocalClipPlanes& clip,
                  const std::optional<LocalLight>& light, const GeometryArrays<const float>& geometry,
                  const VariableArrays<const float>& variable, const SplatRange& range, Chooser& chooser,
                  CutBudget& left, ProjectionCounts& counts) {
  Block block;
  std::array<ClipSide, kBlock> sides{};
  for (size_t begin = range.begin; begin < range.end; begin += kBlock) {
    const size_t count = std::min(kBlock, range.end - begin);
    computeBlock(map, geometry, variable, begin, count, block);
    if (!clip.empty()) clip.sidesOf(geometry, begin, count, sides);
    for (size_t n = 0; n < count; ++n) {
      const size_t i = begin + n;
      bool across = sides[n] == ClipSide::kAcross;
      if (across && !borders) {
        if (!clip.contains({geometry.x[i], geometry.y[i], geometry.z[i]})) sides[n] = ClipSide::kOutside;
        across = false;
      }
      if (sides[n] == ClipSide::kOutside) {
        ++counts.clipped;
        continue;
      }
      Lit lit;
      if (light)
        lit = light->of(geometry.x[i], geometry.y[i], geometry.z[i], shapeOf(geometry, i),
                        slopeOf(variable, i));
      Chooser::Fate fate;
      const uint32_t border_code = borders ? geometry.border_code[begin + n] : kNoBorder;
      if (block.too_wide[n] || border_code != kNoBorder || across) {
        const auto best = choosePieces(map, geometry, variable, begin + n, border_code, borders,
                                       across ? &clip : nullptr, lit, chooser, left);
        if (!best) return false;
        fate = *best;
      } else {
        fate = chooser.choose(
            {block.x[n], block.y[n], block.l11[n], block.l21[n], block.l22[n], block.amplitude[n],
             variable.mean[begin + n], block.slope0[n], block.slope1[n], block.half_width[n]},
            block.depth[n], lit);
      }
      counts.off_screen += fate == Chooser::Fate::kOffScreen;
      counts.transparent += fate == Chooser::Fate::kTransparent;
      counts.drawn += fate == Chooser::Fate::kKept;
    }
  }
  return true;
}

template <typename Map>
bool projectWith(const Map& map, const BorderStyle* borders, const LocalClipPlanes& clip,
                 const std::optional<LocalLight>& light, const GeometryArrays<const float>& geometry,
                 const VariableArrays<const float>& variable, std::span<const SplatRange> ranges,
                 Chooser& chooser, ProjectionCounts& counts) {
  CutBudget left;
  return std::all_of(ranges.begin(), ranges.end(), [&](const SplatRange& range) {
    return projectRange(map, borders, clip, light, geometry, variable, range, chooser, left, counts);
  });
}

}  // namespace

double largestReach(double low_pass_px2) {
  // The slope along L's columns is at most √(x (x + λ)) / (x + ε) times |w|, x the squared extent of the
  // splat on the screen; x below is where that is largest.
  constexpr double kEpsilon = kSlopeLowPass;
  const double farthest =
      std::max(std::sqrt(3.0) * std::abs(kHalfCellStyle.cut.offset / kHalfCellStyle.cut.size), kPartsReach);
  if (low_pass_px2 <= 2 * kEpsilon) return kKernelSupport + farthest;
  const double x = low_pass_px2 * kEpsilon / (low_pass_px2 - 2 * kEpsilon);
  return farthest + kKernelSupport * std::sqrt(x * (x + low_pass_px2)) / (x + kEpsilon);
}

BrickProjector::BrickProjector() {
  splats_.reserve(kMaxSplats);
  depths_.reserve(kMaxSplats);
}

void BrickProjector::project(const ProjectionSettings& settings, const ClassificationTable& table,
                             const glm::dvec3& cell_min, const SplatGeometry& geometry,
                             const SplatVariable& variable) {
  const SplatRange all{0, static_cast<uint32_t>(geometry.size())};
  project(settings, table, cell_min, arraysOf(geometry), arraysOf(variable), {&all, 1});
}

void BrickProjector::project(const ProjectionSettings& settings, const ClassificationTable& table,
                             const glm::dvec3& cell_min, const GeometryArrays<const float>& geometry,
                             const VariableArrays<const float>& variable,
                             std::span<const SplatRange> ranges) {
  CURVISPLAT_CHECK_OP(geometry.size(), ==, variable.size());
  for (const SplatRange& range : ranges) CURVISPLAT_CHECK_OP(range.end, <=, geometry.size());
  const LocalClipPlanes clip(settings.clip_planes, cell_min);
  std::optional<LocalLight> light;
  if (settings.light) light.emplace(*settings.light, settings.light_g0, settings.view, cell_min);
  Chooser chooser(settings, table, splats_, depths_);
  // Where the near plane is too near for float, coarser is not less: then what was cut until there is drawn.
  constexpr float kCoarsest = 1e30f;
  bool complete = false;
  // Beyond a few hundred it is for splats that are in no grid.
  for (float coarseness = 1; !complete && coarseness < kCoarsest; coarseness *= coarseness < 256 ? 2 : 16) {
    splats_.clear();
    depths_.clear();
    counts_ = {};
    const BorderStyle* const borders = coarseness == 1 ? &settings.borders : nullptr;
    complete = settings.view.projection == Projection::kOrthographic
                   ? projectWith(OrthographicMap(settings.view, cell_min), borders, clip, light, geometry,
                                 variable, ranges, chooser, counts_)
                   : projectWith(PerspectiveMap(settings.view, cell_min, coarseness), borders, clip, light,
                                 geometry, variable, ranges, chooser, counts_);
  }
  for (const SplatRange& range : ranges) counts_.read += range.size();
  counts_.pieces = splats_.size();
}

}  // namespace curvisplat
