// Blends a splat over the blocks of a tile. Included once for every instruction set.
#if defined(CURVISPLAT_PAINT_BLOCKS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CURVISPLAT_PAINT_BLOCKS_INL_H
#undef CURVISPLAT_PAINT_BLOCKS_INL_H
#else
#define CURVISPLAT_PAINT_BLOCKS_INL_H
#endif

#include <hwy/highway.h>

#include "render/cpu/paint_shade-inl.h"
#include "render/cpu/tile.h"
#include "render/project/footprint.h"

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

static_assert(kLanes == kBlockPixels);

// The offsets of a block's pixels from its first.
alignas(64) constexpr float kLaneX[kBlockPixels] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
alignas(64) constexpr float kLaneY[kBlockPixels] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};

/// FootprintSkew's factor as a polynomial in p and q: 1 + p (p1 + p (p3 p + p2q q)) + q (q1 + q (pq2 p + q3 q)).
struct SkewPolynomial {
  float p1 = 0, q1 = 0, p3 = 0, p2q = 0, pq2 = 0, q3 = 0;

  explicit SkewPolynomial(uint32_t skew = 0) {
    if (skew == 0) return;
    constexpr auto kScale = static_cast<float>(kKernelSupport / kKernelSigma);
    constexpr float kCubic = kScale * kScale * kScale / 6;
    const FootprintSkew s = FootprintSkew::unpack(skew);
    p1 = -0.5f * kScale * (s.t[0] + s.t[2]);
    q1 = -0.5f * kScale * (s.t[1] + s.t[3]);
    p3 = kCubic * s.t[0];
    p2q = 3 * kCubic * s.t[1];
    pq2 = 3 * kCubic * s.t[2];
    q3 = kCubic * s.t[3];
  }
};

/// An ellipse as its pixels need it. With d the offset from the centre, p = a dx and q = b dx + c dy are u
/// over the support's radius: the footprint ends where p² + q² = 1.
struct Ellipse {
  float x, y;  // the centre, from that of the tile's first pixel
  float a, b, c;
  float amplitude;
  bool skewed;
  SkewPolynomial skew;
};

/// The place of a block's first pixel in the tile.
struct Corner {
  float x, y;
};

/// 1 - exp(-x), x >= 0, over x: relative error below 1e-6. Each lane's bits are its own: most splats are thin, and a vector
/// of these is quicker.
HWY_INLINE V absorbedOf(V x) {
  const Floats d;
  const auto series = [&](V r) HWY_ATTR {  // (exp(r) - 1) / r, |r| <= ln 2 / 2
    V sum = hn::MulAdd(r, hn::Set(d, 1.0f / 720), hn::Set(d, 1.0f / 120));
    sum = hn::MulAdd(sum, r, hn::Set(d, 1.0f / 24));
    sum = hn::MulAdd(sum, r, hn::Set(d, 1.0f / 6));
    sum = hn::MulAdd(sum, r, hn::Set(d, 1.0f / 2));
    return hn::MulAdd(sum, r, hn::Set(d, 1.0f));
  };
  const V thin = series(hn::Neg(x));
  const auto is_thin = hn::Lt(x, hn::Set(d, 0.34f));
  if (hn::AllTrue(d, is_thin)) return thin;
  // exp(-x) = 2^-n exp(r)
  const V held = hn::Min(x, hn::Set(d, 80.0f));
  const V n = hn::Round(hn::Mul(held, hn::Set(d, 1.44269504f)));
  const V r = hn::MulSub(n, hn::Set(d, 0.693147181f), held);
  const V scale = hn::BitCast(d, hn::ShiftLeft<23>(hn::Sub(hn::Set(Ints(), 127), hn::ConvertTo(Ints(), n))));
  const V absorbed = hn::NegMulAdd(hn::Mul(scale, series(r)), r, hn::Sub(hn::Set(d, 1.0f), scale));
  return hn::IfThenElse(is_thin, thin, hn::Div(absorbed, x));
}

/// The number of half widths of its depths, L(tau / 2), by which what is seen of a splat lies nearer than its
/// middle, where its optical depth is tau and its extinction constant. L(x) = coth x - 1 / x.
HWY_INLINE V nearSide(V tau) {
  const Floats d;
  const V two = hn::Set(d, 2.0f), thin = hn::Mul(tau, hn::Set(d, 1.0f / 6));
  const V part = absorbedOf(tau), absorbed = hn::Mul(part, tau);
  const V sum = hn::NegMulAdd(two, part, hn::Sub(two, absorbed));
  const V side = hn::Div(sum, hn::Max(absorbed, hn::Set(d, 1e-30f)));
  return hn::IfThenElse(hn::Lt(tau, hn::Set(d, 0.02f)), thin, side);
}

/// 1 less the variance of the depths that are seen, over that of all.
HWY_INLINE V lostByHiding(V tau, V near_side) {
  const Floats d;
  const V one = hn::Set(d, 1.0f);
  const V part = hn::Div(hn::Mul(hn::Set(d, 4.0f), near_side), hn::Max(tau, hn::Set(d, 1e-30f)));
  const V seen = hn::Mul(hn::Set(d, 3.0f), hn::Sub(hn::NegMulAdd(near_side, near_side, one), part));
  return hn::IfThenElseZero(hn::Ge(tau, hn::Set(d, 0.02f)), hn::Sub(one, hn::Clamp(seen, hn::Zero(d), one)));
}

/// The values of all of a splat, with the colour of what is seen of it. Where the seen side has hardly any extinction,
/// the colour is that of all.
HWY_INLINE void showNearSide(const V (&seen)[4], V (&value)[4]) {
  const Floats d;
  const V all = value[3], a_little = hn::Mul(hn::Set(d, 1.0f / 64), all);
  const V factor = hn::Div(all, hn::Max(hn::Add(seen[3], a_little), hn::Set(d, 1e-37f)));
  for (int c = 0; c < 3; ++c)
    value[c] = hn::Mul(factor, hn::MulAdd(hn::Set(d, 1.0f / 64), value[c], seen[c]));
}

/// The place of some pixels in an ellipse: p, q, and 1 - p² - q², which is above zero in the footprint.
struct Pixels {
  V p, q, inside;

  HWY_INLINE hn::Mask<Floats> inFootprint() const { return hn::Gt(inside, hn::Zero(Floats())); }
  /// Most splats are small: they touch three to five pixels of a block, and so often one vector of two.
  HWY_INLINE bool areOutside() const { return hn::AllFalse(Floats(), inFootprint()); }
};

/// The pixels of a block, from `lane` on.
HWY_INLINE Pixels pixelsAt(const Ellipse& e, Corner corner, size_t lane) {
  const Floats d;
  const V dx = hn::Add(hn::Load(d, kLaneX + lane), hn::Set(d, corner.x - e.x));
  const V dy = hn::Add(hn::Load(d, kLaneY + lane), hn::Set(d, corner.y - e.y));
  const V p = hn::Mul(hn::Set(d, e.a), dx);
  const V q = hn::MulAdd(hn::Set(d, e.b), dx, hn::Mul(hn::Set(d, e.c), dy));
  return {p, q, hn::NegMulAdd(q, q, hn::NegMulAdd(p, p, hn::Set(d, 1.0f)))};
}

/// Optical depth per unit of extinction: zero outside of the footprint.
HWY_INLINE V depthAt(const Ellipse& e, const float* HWY_RESTRICT footprint, const Pixels& pixels) {
  const Floats d;
  const auto& [p, q, inside] = pixels;
  const V x = hn::Max(inside, hn::Zero(d));
  const V x2 = hn::Mul(x, x), x4 = hn::Mul(x2, x2);
  const auto pair = [&](int n) HWY_ATTR {
    return hn::MulAdd(hn::Set(d, footprint[n + 1]), x, hn::Set(d, footprint[n]));
  };
  const V lo = hn::MulAdd(pair(2), x2, pair(0)), hi = hn::MulAdd(pair(6), x2, pair(4));
  const V f = hn::MulAdd(hn::MulAdd(hn::Set(d, footprint[8]), x4, hi), x4, lo);
  V depth = hn::Mul(hn::Mul(f, hn::Set(d, e.amplitude)), hn::Mul(x, x));
  if (e.skewed) {
    const SkewPolynomial& s = e.skew;
    const V by_p =
        hn::MulAdd(hn::MulAdd(hn::Set(d, s.p3), p, hn::Mul(hn::Set(d, s.p2q), q)), p, hn::Set(d, s.p1));
    const V by_q =
        hn::MulAdd(hn::MulAdd(hn::Set(d, s.q3), q, hn::Mul(hn::Set(d, s.pq2), p)), q, hn::Set(d, s.q1));
    const V factor = hn::MulAdd(by_p, p, hn::MulAdd(by_q, q, hn::Set(d, 1.0f)));
    depth = hn::Mul(depth, hn::Max(factor, hn::Zero(d)));
  }
  return depth;
}

/// Blends one vector of pixels under the splats before, whose colours and transmittance these are.
HWY_INLINE void blend(V depth, const V (&value)[4], V (&colour)[3], V& through) {
  // A parabola may end below zero, by its error.
  const V tau = hn::Max(hn::Mul(depth, value[3]), hn::Zero(Floats()));
  const V part = absorbedOf(tau);
  const V weight = hn::Mul(hn::Mul(depth, part), through);
  for (int c = 0; c < 3; ++c) colour[c] = hn::MulAdd(value[c], weight, colour[c]);
  through = hn::NegMulAdd(hn::Mul(tau, part), through, through);
}

/// The same in a block. Returns the transmittance that is left.
HWY_INLINE V blendUnder(float* HWY_RESTRICT at, V depth, const V (&value)[4]) {
  const Floats d;
  V colour[3], through = hn::Load(d, at + 3 * kBlockPixels);
  for (int c = 0; c < 3; ++c) colour[c] = hn::Load(d, at + c * kBlockPixels);
  blend(depth, value, colour, through);
  for (int c = 0; c < 3; ++c) hn::Store(colour[c], d, at + c * kBlockPixels);
  hn::Store(through, d, at + 3 * kBlockPixels);
  return through;
}

/// s = s0 + sp p + sq q.
struct Along {
  float s0, sp, sq;

  HWY_INLINE V at(const Pixels& pixels) const {
    const Floats d;
    return hn::MulAdd(hn::Set(d, sp), pixels.p, hn::MulAdd(hn::Set(d, sq), pixels.q, hn::Set(d, s0)));
  }
};

/// One parabola, or one colour: at + s (by + s bend).
struct Shade {
  float at[4], by[4], bend[4];
  Along s;

  template <bool kFitted>
  HWY_INLINE void valuesAt(const Pixels& pixels, V (&value)[4]) const {
    const Floats d;
    if constexpr (kFitted) {
      const V x = s.at(pixels);
      for (int c = 0; c < 4; ++c)
        value[c] = hn::MulAdd(hn::MulAdd(hn::Set(d, bend[c]), x, hn::Set(d, by[c])), x, hn::Set(d, at[c]));
    } else {
      for (int c = 0; c < 4; ++c) value[c] = hn::Set(d, at[c]);
    }
  }
};

HWY_INLINE bool isSaturated(V transmittance) {
  return hn::AllTrue(Floats(), hn::Lt(transmittance, hn::Set(Floats(), kSaturated)));
}

/// The colours and transmittances of a block, in registers.
class BlockColours {
 public:
  static constexpr size_t kVectors = kBlockPixels / hn::MaxLanes(Floats());

  HWY_INLINE explicit BlockColours(const float* HWY_RESTRICT block) { load(block); }
  HWY_INLINE void load(const float* HWY_RESTRICT block) {
    const Floats d;
    for (size_t v = 0; v < kVectors; ++v) {
      for (int c = 0; c < 3; ++c) colour_[v][c] = hn::Load(d, block + c * kBlockPixels + v * hn::Lanes(d));
      through_[v] = hn::Load(d, block + 3 * kBlockPixels + v * hn::Lanes(d));
    }
  }
  HWY_INLINE void store(float* HWY_RESTRICT block) const {
    const Floats d;
    for (size_t v = 0; v < kVectors; ++v) {
      for (int c = 0; c < 3; ++c) hn::Store(colour_[v][c], d, block + c * kBlockPixels + v * hn::Lanes(d));
      hn::Store(through_[v], d, block + 3 * kBlockPixels + v * hn::Lanes(d));
    }
  }
  /// Blends vector v under what there is.
  HWY_INLINE void blendUnder(size_t v, V depth, const V (&value)[4]) {
    blend(depth, value, colour_[v], through_[v]);
  }
  HWY_INLINE bool areSaturated() const {
    V most = through_[0];
    for (size_t v = 1; v < kVectors; ++v) most = hn::Max(most, through_[v]);
    return isSaturated(most);
  }

 private:
  V colour_[kVectors][3], through_[kVectors];
};

/// Blends a splat over a block: values_at(pixels, out).
template <typename ValuesAt>
HWY_INLINE void blendOver(const Ellipse& e, const float* HWY_RESTRICT footprint, Corner corner,
                          const ValuesAt& values_at, BlockColours& colours) {
  for (size_t v = 0; v < BlockColours::kVectors; ++v) {
    const Pixels pixels = pixelsAt(e, corner, v * hn::Lanes(Floats()));
    if (pixels.areOutside()) continue;
    const V depth = depthAt(e, footprint, pixels);
    V value[4];
    values_at(pixels, value);
    colours.blendUnder(v, depth, value);
  }
}

/// Blends a splat of one parabola, or one colour, over a block.
HWY_INLINE void blendOver(const Ellipse& e, const float* HWY_RESTRICT footprint, Corner corner,
                          const Shade& shade, bool fitted, BlockColours& colours) {
  blendOver(
      e, footprint, corner,
      [&](const Pixels& pixels, V(&value)[4]) HWY_ATTR {
        if (fitted)
          shade.valuesAt<true>(pixels, value);
        else
          shade.valuesAt<false>(pixels, value);
      },
      colours);
}

/// Blends a splat of lines, along s, over a block.
HWY_INLINE void blendOver(const Ellipse& e, const float* HWY_RESTRICT footprint, Corner corner,
                          const Along& s, const Lines& lines, BlockColours& colours) {
  blendOver(
      e, footprint, corner,
      [&](const Pixels& pixels, V(&value)[4]) HWY_ATTR { lines.valuesAt(s.at(pixels), value); }, colours);
}

/// Paints a block: blend(its colours). Returns whether it is saturated then.
template <typename Blend>
HWY_INLINE bool paintBlock(float* HWY_RESTRICT block, const Blend& blend) {
  BlockColours colours(block);
  blend(colours);
  colours.store(block);
  return colours.areSaturated();
}

/// The scalar: mean + reach (tp p + tq q), ± half_width. What is seen of the splat, if that is something else, has the
/// means less `nearer`, and another half width.
struct Scalar {
  float mean, reach, tp, tq, half_width;
  float nearer = 0, seen_half_width = 0;

  HWY_INLINE V meanAt(const Pixels& pixels) const {
    const Floats d;
    const V t = hn::MulAdd(hn::Set(d, tp), pixels.p, hn::Mul(hn::Set(d, tq), pixels.q));
    return hn::MulAdd(hn::Set(d, reach), t, hn::Set(d, mean));
  }
};

/// A block of which every pixel that the splat touches is looked up: one whose bit is set. The others have no depth, so that
/// their integrals count for nothing; they may be those of an earlier block, which are finite.
struct LookedUp {
  uint32_t touched;
  bool finite = false;  // all integrals
  Row depth, scale;
  alignas(64) float integrals[4 * kLanes];  // of one pixel after the other

  HWY_INLINE void integrate(const ShadingTable& table, const Intervals& intervals) {
    if (!finite) clear(integrals);
    finite = true;
    integrateEach(table, intervals, touched, integrals);
  }
};

/// The tables for looking pixels up: the integrals of the classification, and footprintPolynomial().
struct Tables {
  const ShadingTable& shading;
  const float* footprint;
};

/// Replaces what was looked up by what is seen of it: by the intervals of the nearer side.
HWY_INLINE void showNearSides(const ShadingTable& table, const Intervals& nearer, LookedUp& out) {
  const Floats d;
  alignas(64) float integrals[4 * kLanes];
  clear(integrals);
  integrateEach(table, nearer, out.touched, integrals);
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    if (!anyOf(out.touched, lane)) continue;
    V seen[4], value[4];
    meansOf(integrals, hn::Load(d, nearer.scale.at + lane), lane, seen);
    meansOf(out.integrals, hn::Load(d, out.scale.at + lane), lane, value);
    showNearSide(seen, value);
    hn::StoreInterleaved4(value[0], value[1], value[2], value[3], d, out.integrals + 4 * lane);
    hn::Store(hn::Set(d, 1.0f), d, out.scale.at + lane);
  }
}

HWY_INLINE bool lookUpBlock(const Ellipse& e, const Scalar& scalar, const Tables& tables, Corner corner,
                            LookedUp& out) {
  const float* HWY_RESTRICT footprint = tables.footprint;
  const Floats d;
  Intervals intervals, nearer;
  const bool hides = scalar.nearer != 0;
  out.touched = 0;
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const Pixels pixels = pixelsAt(e, corner, lane);
    const uint32_t touched = bitsOf(pixels.inFootprint());
    if (touched == 0) continue;
    out.touched |= touched << lane;
    hn::Store(depthAt(e, footprint, pixels), d, out.depth.at + lane);
    const V mean = scalar.meanAt(pixels);
    locate(tables.shading, mean, hn::Set(d, scalar.half_width), lane, intervals);
    hn::Store(hn::Load(d, intervals.scale.at + lane), d, out.scale.at + lane);
    if (hides)
      locate(tables.shading, hn::Sub(mean, hn::Set(d, scalar.nearer)), hn::Set(d, scalar.seen_half_width),
             lane, nearer);
  }
  if (out.touched == 0) return false;
  out.integrate(tables.shading, intervals);
  if (hides) showNearSides(tables.shading, nearer, out);
  return true;
}

HWY_INLINE void blendLookedUp(const LookedUp& in, const Lit& lit, BlockColours& colours) {
  const Floats d;
  for (size_t v = 0; v < BlockColours::kVectors; ++v) {
    const size_t lane = v * hn::Lanes(d);
    if (!anyOf(in.touched, lane)) continue;
    V value[4];
    meansOf(in.integrals, hn::Load(d, in.scale.at + lane), lane, value);
    const V white = hn::Mul(value[3], hn::Set(d, lit.specular));
    for (int c = 0; c < 3; ++c) value[c] = hn::MulAdd(value[c], hn::Set(d, lit.diffuse), white);
    colours.blendUnder(v, hn::Load(d, in.depth.at + lane), value);
  }
}

HWY_INLINE bool paintLookedUp(const LookedUp& in, const Lit& lit, float* HWY_RESTRICT block) {
  return paintBlock(block, [&](BlockColours& colours) HWY_ATTR { blendLookedUp(in, lit, colours); });
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#endif
