#include <cmath>

#include "render/kernel.h"
#include "render/tile.h"

// Once for every instruction set that a processor may have, from here to HWY_AFTER_NAMESPACE.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/paint_tile.cpp"
#include <hwy/foreach_target.h>  // before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kBlockPixels>;
using V = hn::Vec<Floats>;

// How far the mean of extinction, and of colour times extinction, may be from the table's: this part of the
// extinction there is, or this optical depth.
constexpr float kRelativeError = 1.0f / 1024;
constexpr float kDepthError = 1e-5f;

constexpr float kPeak = 0.69995f;  // F(0), and a little

// The offsets of a block's pixels from its first.
alignas(64) constexpr float kLaneX[kBlockPixels] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
alignas(64) constexpr float kLaneY[kBlockPixels] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

/// An ellipse as its pixels need it. With d the offset from the centre, p = a dx and q = b dx + c dy are u
/// over the support's radius: the footprint ends where p² + q² = 1.
struct Ellipse {
  float x, y;  // the centre, from that of the tile's first pixel
  float a, b, c;
  float amplitude;

  // How the scalar changes: mean + reach t, with t = tp p + tq q in [-1, 1] where there is a footprint.
  float mean, reach, tp, tq, half_width;
};

struct Range {
  float from, to;
};

/// Pixels or blocks of a tile, the last included.
struct Box {
  int x0, y0, x1, y1;
};

/// Colour times extinction, and extinction, over a piece of a splat: at + by t.
struct Shade {
  ShadingTable::Value at, by;
};

enum class Fit { nothing, constant, linear, none };

HWY_INLINE Ellipse ellipseOf(const ScreenSplat& splat, const TileWork& work) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  constexpr float kInverse = 1 / kSupport;
  Ellipse e;
  e.x = splat.x - (static_cast<float>(work.x) + 0.5f);
  e.y = splat.y - (static_cast<float>(work.y) + 0.5f);
  e.a = kInverse / splat.l11;
  e.c = kInverse / splat.l22;
  e.b = -splat.l21 * e.a / splat.l22;
  e.amplitude = splat.amplitude;
  e.mean = splat.mean;
  if (work.per_pixel) {
    const float slope = std::sqrt(splat.slope0 * splat.slope0 + splat.slope1 * splat.slope1);
    const float inverse = slope > 0 ? 1 / slope : 0.0f;
    e.reach = kSupport * slope;
    e.tp = splat.slope0 * inverse;
    e.tq = splat.slope1 * inverse;
    e.half_width = splat.half_width;
  } else {
    e.reach = e.tp = e.tq = e.half_width = 0;
  }
  return e;
}

/// What a pixel with this mean sees, in cells: never less than a cell.
HWY_INLINE Range seen(const ShadingTable& table, float mean, float half_width) {
  const float from = table.cellsOf(mean - half_width), to = table.cellsOf(mean + half_width);
  const float widen = std::max(0.0f, 0.5f * (1 - (to - from)));
  return {from - widen, to + widen};
}

/// A straight line, or less, for t in `over`, if that is good enough.
HWY_INLINE Fit fit(const ShadingTable& table, const Ellipse& e, Range over, Shade& shade) {
  const Range low = seen(table, e.mean + e.reach * over.from, e.half_width);
  const Range high = seen(table, e.mean + e.reach * over.to, e.half_width);
  const float move = std::max(high.to - low.to, high.from - low.from);
  const float width = low.to - low.from;
  const ShadingTable::Value a = table.mean(low.from, low.to), b = table.mean(high.from, high.to);
  float error = 0.25f * move * std::min(1.0f, move / width) * table.bend(low.from, high.to);
  float change = 0;
  for (int c = 0; c < 4; ++c) change = std::max(change, std::abs(b.of[c] - a.of[c]));
  // The logarithm bends by move² / (8 scale) cells.
  if (table.logScale()) error += 0.5f * change * move / table.scale();
  const float most = std::max(a.of[3], b.of[3]);
  const float allowed = std::max(kRelativeError * most, kDepthError / (kPeak * e.amplitude));
  if (error > allowed) return Fit::none;
  if (most == 0) return Fit::nothing;
  if (error + 0.5f * change <= allowed) {
    for (int c = 0; c < 4; ++c) shade.at.of[c] = 0.5f * (a.of[c] + b.of[c]);
    return Fit::constant;
  }
  const float per_t = 1 / (over.to - over.from);
  for (int c = 0; c < 4; ++c) {
    shade.by.of[c] = (b.of[c] - a.of[c]) * per_t;
    shade.at.of[c] = a.of[c] - shade.by.of[c] * over.from;
  }
  return Fit::linear;
}

/// The t of the pixels in a box.
HWY_INLINE Range tOver(const Ellipse& e, float x0, float x1, float y0, float y1) {
  const float by_x = e.tp * e.a + e.tq * e.b, by_y = e.tq * e.c;
  const float middle = by_x * (0.5f * (x0 + x1) - e.x) + by_y * (0.5f * (y0 + y1) - e.y);
  const float half = 0.5f * (std::abs(by_x) * (x1 - x0) + std::abs(by_y) * (y1 - y0));
  return {std::max(middle - half, -1.0f), std::min(middle + half, 1.0f)};
}

/// The pixels of the tile that lie in the ellipse's own rectangle.
HWY_INLINE Box pixelsOf(const ScreenSplat& splat, const Ellipse& e) {
  constexpr auto kSupport = static_cast<float>(kKernelSupport);
  constexpr float kLast = kTileSide - 1;
  const float reach_x = kSupport * splat.l11;
  const float reach_y = kSupport * std::sqrt(splat.l21 * splat.l21 + splat.l22 * splat.l22);
  return {static_cast<int>(std::clamp(std::ceil(e.x - reach_x), 0.0f, kLast + 1)),
          static_cast<int>(std::clamp(std::ceil(e.y - reach_y), 0.0f, kLast + 1)),
          static_cast<int>(std::clamp(std::floor(e.x + reach_x), -1.0f, kLast)),
          static_cast<int>(std::clamp(std::floor(e.y + reach_y), -1.0f, kLast))};
}

/// 1 - exp(-x), x >= 0, over x: relative error below 1e-6 for any x.
template <bool kThin>
HWY_INLINE V absorbedOf(V x) {
  const Floats d;
  // exp(-x) = 2^-n exp(r), |r| <= ln 2 / 2
  V r = hn::Neg(x), scale = hn::Set(d, 1.0f);
  if constexpr (!kThin) {
    const V held = hn::Min(x, hn::Set(d, 80.0f));
    const V n = hn::Round(hn::Mul(held, hn::Set(d, 1.44269504f)));
    r = hn::MulSub(n, hn::Set(d, 0.693147181f), held);
    const hn::RebindToSigned<Floats> di;
    scale = hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(hn::Set(di, 127), hn::ConvertTo(di, n))));
  }
  V series = hn::MulAdd(r, hn::Set(d, 1.0f / 720), hn::Set(d, 1.0f / 120));
  series = hn::MulAdd(series, r, hn::Set(d, 1.0f / 24));
  series = hn::MulAdd(series, r, hn::Set(d, 1.0f / 6));
  series = hn::MulAdd(series, r, hn::Set(d, 1.0f / 2));
  series = hn::MulAdd(series, r, hn::Set(d, 1.0f));
  if constexpr (kThin) return series;
  const V absorbed = hn::NegMulAdd(hn::Mul(scale, series), r, hn::Sub(hn::Set(d, 1.0f), scale));
  return hn::Div(absorbed, hn::Max(x, hn::Set(d, 1e-30f)));
}

/// Optical depth per unit of extinction, zero outside of the footprint; and t.
struct Pixels {
  V depth, p, q;
};

HWY_INLINE Pixels pixelsAt(const Ellipse& e, const float* footprint, V dx, V dy) {
  const Floats d;
  const V p = hn::Mul(hn::Set(d, e.a), dx);
  const V q = hn::MulAdd(hn::Set(d, e.b), dx, hn::Mul(hn::Set(d, e.c), dy));
  const V x = hn::Max(hn::NegMulAdd(q, q, hn::NegMulAdd(p, p, hn::Set(d, 1.0f))), hn::Zero(d));
  V f = hn::Set(d, footprint[kFootprintTerms - 1]);
  for (int n = kFootprintTerms - 2; n >= 0; --n) f = hn::MulAdd(f, x, hn::Set(d, footprint[n]));
  return {hn::Mul(hn::Mul(f, hn::Set(d, e.amplitude)), hn::Mul(x, x)), p, q};
}

/// Blends over one vector of a block's pixels.
template <bool kThin>
HWY_INLINE void blend(float* at, V depth, const V& red, const V& green, const V& blue, const V& extinction) {
  const Floats d;
  // A straight line may end a rounding error below zero.
  const V tau = hn::Max(hn::Mul(depth, extinction), hn::Zero(d));
  const V part = absorbedOf<kThin>(tau);
  const V weight = hn::Mul(depth, part);
  const V through = hn::NegMulAdd(tau, part, hn::Set(d, 1.0f));
  const auto channel = [&](int c, V colour) HWY_ATTR {
    float* place = at + c * kBlockPixels;
    hn::Store(hn::MulAdd(hn::Load(d, place), through, hn::Mul(colour, weight)), d, place);
  };
  channel(0, red);
  channel(1, green);
  channel(2, blue);
  float* place = at + 3 * kBlockPixels;
  hn::Store(hn::Mul(hn::Load(d, place), through), d, place);
}

/// One block. `x`, `y`: of its first pixel, in the tile.
template <bool kLinear, bool kThin>
HWY_INLINE void paintBlock(const Ellipse& e, const Shade& shade, const float* footprint, float* block,
                           float x, float y) {
  const Floats d;
  const V from_x = hn::Set(d, x - e.x), from_y = hn::Set(d, y - e.y);
  for (size_t lane = 0; lane < kBlockPixels; lane += hn::Lanes(d)) {
    const Pixels pixels = pixelsAt(e, footprint, hn::Add(hn::Load(d, kLaneX + lane), from_x),
                                   hn::Add(hn::Load(d, kLaneY + lane), from_y));
    V values[4];
    if constexpr (kLinear) {
      const V t = hn::MulAdd(hn::Set(d, e.tp), pixels.p, hn::Mul(hn::Set(d, e.tq), pixels.q));
      for (int c = 0; c < 4; ++c)
        values[c] = hn::MulAdd(hn::Set(d, shade.by.of[c]), t, hn::Set(d, shade.at.of[c]));
    } else {
      for (int c = 0; c < 4; ++c) values[c] = hn::Set(d, shade.at.of[c]);
    }
    blend<kThin>(block + lane, pixels.depth, values[0], values[1], values[2], values[3]);
  }
}

/// One block, with two look-ups for each of its pixels.
HWY_INLINE void paintBlockExactly(const Ellipse& e, const ShadingTable& table, const float* footprint,
                                  float* block, float x, float y) {
  const Floats d;
  const V from_x = hn::Set(d, x - e.x), from_y = hn::Set(d, y - e.y);
  alignas(64) float depths[kBlockPixels], means[kBlockPixels], values[4][kBlockPixels];
  for (size_t lane = 0; lane < kBlockPixels; lane += hn::Lanes(d)) {
    const Pixels pixels = pixelsAt(e, footprint, hn::Add(hn::Load(d, kLaneX + lane), from_x),
                                   hn::Add(hn::Load(d, kLaneY + lane), from_y));
    const V t = hn::MulAdd(hn::Set(d, e.tp), pixels.p, hn::Mul(hn::Set(d, e.tq), pixels.q));
    hn::Store(pixels.depth, d, depths + lane);
    hn::Store(hn::MulAdd(hn::Set(d, e.reach), t, hn::Set(d, e.mean)), d, means + lane);
  }
  for (int n = 0; n < kBlockPixels; ++n) {
    if (depths[n] > 0) {
      const Range range = seen(table, means[n], e.half_width);
      const ShadingTable::Value value = table.mean(range.from, range.to);
      for (int c = 0; c < 4; ++c) values[c][n] = value.of[c];
    } else {
      for (int c = 0; c < 4; ++c) values[c][n] = 0;
    }
  }
  for (size_t lane = 0; lane < kBlockPixels; lane += hn::Lanes(d))
    blend<false>(block + lane, hn::Load(d, depths + lane), hn::Load(d, values[0] + lane),
                 hn::Load(d, values[1] + lane), hn::Load(d, values[2] + lane), hn::Load(d, values[3] + lane));
}

HWY_INLINE bool isThin(const Ellipse& e, const Shade& shade, Fit kind) {
  float most = shade.at.of[3];
  if (kind == Fit::linear) most += std::abs(shade.by.of[3]);
  return e.amplitude * kPeak * most < 0.34f;
}

/// The blocks of a splat in a tile, row by row: those of its rectangle that its ellipse touches.
class BlockRows {
 public:
  HWY_INLINE BlockRows(const ScreenSplat& splat, const Ellipse& e, const Box& pixels)
      : box_{pixels.x0 / kBlockSide, pixels.y0 / kBlockSide, pixels.x1 / kBlockSide, pixels.y1 / kBlockSide} {
    trimmed_ = box_.y1 - box_.y0 > 1 && box_.x1 > box_.x0;
    if (!trimmed_) return;
    // A row at dy is dx = lean dy ± span √(reach² - dy²); farthest right at dy = tip.
    constexpr auto kSupport = static_cast<float>(kKernelSupport);
    const float s11 = splat.l21 * splat.l21 + splat.l22 * splat.l22;
    const float inverse = 1 / s11;
    const float lean = splat.l11 * splat.l21 * inverse, span = splat.l11 * splat.l22 * inverse;
    const float reach2 = kSupport * kSupport * s11, tip = kSupport * splat.l21;
    for (int row = 0; row < kTileBlocks; ++row) {
      const float top = static_cast<float>(row * kBlockSide) - e.y;
      const float bottom = top + (kBlockSide - 1);
      const float right = std::clamp(tip, top, bottom), left = std::clamp(-tip, top, bottom);
      const float to = lean * right + span * std::sqrt(std::max(0.0f, reach2 - right * right));
      const float from = lean * left - span * std::sqrt(std::max(0.0f, reach2 - left * left));
      from_[row] = (e.x + from - 0.01f) * (1.0f / kBlockSide) - (kBlockSide - 1.0f) / kBlockSide;
      to_[row] = (e.x + to + 0.01f) * (1.0f / kBlockSide);
    }
  }
  template <typename Paint>
  HWY_INLINE void each(const Paint& paint) const {
    for (int row = box_.y0; row <= box_.y1; ++row) {
      int from = box_.x0, to = box_.x1;
      if (trimmed_) {
        from = std::max(from, static_cast<int>(std::ceil(std::clamp(from_[row], -1.0f, float{kTileBlocks}))));
        to = std::min(to, static_cast<int>(std::floor(std::clamp(to_[row], -1.0f, float{kTileBlocks}))));
      }
      for (int column = from; column <= to; ++column) paint(column, row);
    }
  }

 private:
  Box box_;
  bool trimmed_;
  float from_[kTileBlocks], to_[kTileBlocks];  // in blocks
};

template <bool kLinear, bool kThin>
HWY_INLINE void paintBlocks(const TileWork& work, const BlockRows& rows, const Ellipse& e, const Shade& shade,
                            const float* footprint) {
  rows.each([&](int column, int row) HWY_ATTR {
    paintBlock<kLinear, kThin>(e, shade, footprint, work.tile + (row * kTileBlocks + column) * kBlockFloats,
                               static_cast<float>(column * kBlockSide), static_cast<float>(row * kBlockSide));
  });
}

/// Where one straight line does not do for all of the tile: one for every block, if that does.
HWY_NOINLINE void paintBlockByBlock(const TileWork& work, const BlockRows& rows, const Ellipse& e,
                                    const float* footprint) {
  rows.each([&](int column, int row) HWY_ATTR {
    float* block = work.tile + (row * kTileBlocks + column) * kBlockFloats;
    const auto x = static_cast<float>(column * kBlockSide), y = static_cast<float>(row * kBlockSide);
    const Range over = tOver(e, x, x + kBlockSide - 1, y, y + kBlockSide - 1);
    if (over.from > over.to) return;
    Shade shade;
    switch (fit(work.table, e, over, shade)) {
      case Fit::nothing:
        return;
      case Fit::constant:
        return paintBlock<false, false>(e, shade, footprint, block, x, y);
      case Fit::linear:
        return paintBlock<true, false>(e, shade, footprint, block, x, y);
      case Fit::none:
        return paintBlockExactly(e, work.table, footprint, block, x, y);
    }
  });
}

void paintTile(const TileWork& work) {
  const float* footprint = footprintPolynomial();
  for (const uint32_t index : work.order) {
    const ScreenSplat& splat = work.splats[index];
    const Ellipse e = ellipseOf(splat, work);
    const Box pixels = pixelsOf(splat, e);
    if (pixels.x0 > pixels.x1 || pixels.y0 > pixels.y1) continue;
    const Range over = tOver(e, static_cast<float>(pixels.x0), static_cast<float>(pixels.x1),
                             static_cast<float>(pixels.y0), static_cast<float>(pixels.y1));
    if (over.from > over.to) continue;
    Shade shade;
    const Fit kind = fit(work.table, e, over, shade);
    if (kind == Fit::nothing) continue;
    const BlockRows rows(splat, e, pixels);
    if (kind == Fit::none) {
      paintBlockByBlock(work, rows, e, footprint);
    } else if (isThin(e, shade, kind)) {
      if (kind == Fit::constant)
        paintBlocks<false, true>(work, rows, e, shade, footprint);
      else
        paintBlocks<true, true>(work, rows, e, shade, footprint);
    } else {
      if (kind == Fit::constant)
        paintBlocks<false, false>(work, rows, e, shade, footprint);
      else
        paintBlocks<true, false>(work, rows, e, shade, footprint);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(paintTile);

void paintTile(const TileWork& work) {
  HWY_DYNAMIC_DISPATCH(paintTile)(work);
}

}  // namespace curvisplat
#endif
