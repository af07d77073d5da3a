// Blends a splat over the blocks of a tile. Included once for every instruction set.
#if defined(CURVISPLAT_PAINT_BLOCKS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CURVISPLAT_PAINT_BLOCKS_INL_H
#undef CURVISPLAT_PAINT_BLOCKS_INL_H
#else
#define CURVISPLAT_PAINT_BLOCKS_INL_H
#endif

#include <hwy/highway.h>

#include "render/paint_shade-inl.h"
#include "render/tile.h"

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

static_assert(kLanes == kBlockPixels);

// The offsets of a block's pixels from its first.
alignas(64) constexpr float kLaneX[kBlockPixels] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
alignas(64) constexpr float kLaneY[kBlockPixels] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

/// An ellipse as its pixels need it. With d the offset from the centre, p = a dx and q = b dx + c dy are u
/// over the support's radius: the footprint ends where p² + q² = 1.
struct Ellipse {
  float x, y;  // the centre, from that of the tile's first pixel
  float a, b, c;
  float amplitude;
};

/// 1 - exp(-x), x >= 0, over x: relative error below 1e-6. `kThin`: for x <= ln 2 / 2, with the same bits.
template <bool kThin>
HWY_INLINE V absorbedOf(V x) {
  const Floats d;
  // exp(-x) = 2^-n exp(r), |r| <= ln 2 / 2
  V r = hn::Neg(x), scale = hn::Set(d, 1.0f);
  if constexpr (!kThin) {
    const V held = hn::Min(x, hn::Set(d, 80.0f));
    const V n = hn::Round(hn::Mul(held, hn::Set(d, 1.44269504f)));
    r = hn::MulSub(n, hn::Set(d, 0.693147181f), held);
    scale = hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(hn::Set(Ints(), 127), hn::ConvertTo(Ints(), n))));
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

/// Optical depth per unit of extinction, zero outside of the footprint; and p and q.
struct Pixels {
  V depth, p, q;
};

HWY_INLINE Pixels pixelsAt(const Ellipse& e, const float* HWY_RESTRICT footprint, V dx, V dy) {
  const Floats d;
  const V p = hn::Mul(hn::Set(d, e.a), dx);
  const V q = hn::MulAdd(hn::Set(d, e.b), dx, hn::Mul(hn::Set(d, e.c), dy));
  const V x = hn::Max(hn::NegMulAdd(q, q, hn::NegMulAdd(p, p, hn::Set(d, 1.0f))), hn::Zero(d));
  const V x2 = hn::Mul(x, x), x4 = hn::Mul(x2, x2);
  const auto pair = [&](int n) HWY_ATTR {
    return hn::MulAdd(hn::Set(d, footprint[n + 1]), x, hn::Set(d, footprint[n]));
  };
  const V lo = hn::MulAdd(pair(2), x2, pair(0)), hi = hn::MulAdd(pair(6), x2, pair(4));
  const V f = hn::MulAdd(hn::MulAdd(hn::Set(d, footprint[8]), x4, hi), x4, lo);
  return {hn::Mul(hn::Mul(f, hn::Set(d, e.amplitude)), hn::Mul(x, x)), p, q};
}

/// Blends over one vector of a block's pixels.
template <bool kThin>
HWY_INLINE void blend(float* HWY_RESTRICT at, V depth, V red, V green, V blue, V extinction) {
  const Floats d;
  // A parabola may end below zero, by its error.
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
template <bool kConstant, bool kThin>
HWY_INLINE void paintBlock(const Ellipse& e, const Shade& shade, const float* HWY_RESTRICT footprint,
                           float* HWY_RESTRICT block, float x, float y) {
  const Floats d;
  const V from_x = hn::Set(d, x - e.x), from_y = hn::Set(d, y - e.y);
  for (size_t lane = 0; lane < kBlockPixels; lane += hn::Lanes(d)) {
    const Pixels pixels = pixelsAt(e, footprint, hn::Add(hn::Load(d, kLaneX + lane), from_x),
                                   hn::Add(hn::Load(d, kLaneY + lane), from_y));
    V s = hn::Zero(d);
    if constexpr (!kConstant)
      s = hn::MulAdd(hn::Set(d, shade.sp), pixels.p,
                     hn::MulAdd(hn::Set(d, shade.sq), pixels.q, hn::Set(d, shade.s0)));
    const auto value = [&](int c) HWY_ATTR {
      if constexpr (kConstant) return hn::Set(d, shade.at[c]);
      return hn::MulAdd(hn::MulAdd(hn::Set(d, shade.bend[c]), s, hn::Set(d, shade.by[c])), s,
                        hn::Set(d, shade.at[c]));
    };
    blend<kThin>(block + lane, pixels.depth, value(0), value(1), value(2), value(3));
  }
}

/// The scalar: mean + reach (tp p + tq q), ± half_width.
struct Scalar {
  float mean, reach, tp, tq, half_width;
};

/// One block, with a look-up for each of its pixels.
HWY_INLINE void paintBlockExactly(const Ellipse& e, const Scalar& scalar, const ShadingTable& table,
                                  const float* HWY_RESTRICT footprint, float* HWY_RESTRICT block, float x,
                                  float y) {
  const Floats d;
  const V from_x = hn::Set(d, x - e.x), from_y = hn::Set(d, y - e.y);
  Row depths;
  Intervals intervals;
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const Pixels pixels = pixelsAt(e, footprint, hn::Add(hn::Load(d, kLaneX + lane), from_x),
                                   hn::Add(hn::Load(d, kLaneY + lane), from_y));
    const V t = hn::MulAdd(hn::Set(d, scalar.tp), pixels.p, hn::Mul(hn::Set(d, scalar.tq), pixels.q));
    hn::Store(pixels.depth, d, depths.at + lane);
    locate(table, hn::MulAdd(hn::Set(d, scalar.reach), t, hn::Set(d, scalar.mean)),
           hn::Set(d, scalar.half_width), lane, intervals);
  }
  alignas(64) float values[4 * kLanes];  // of one pixel after the other
  for (size_t n = 0; n < kLanes; ++n) meanOver(table, intervals, n, values + 4 * n);
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    V red, green, blue, extinction;
    hn::LoadInterleaved4(d, values + 4 * lane, red, green, blue, extinction);
    blend<false>(block + lane, hn::Load(d, depths.at + lane), red, green, blue, extinction);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#endif
