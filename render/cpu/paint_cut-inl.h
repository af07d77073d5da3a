// Blends what is left of a splat that is cut: at faces, and to the windows of depth between the layers of its
// pixels. Included once for every instruction set.
#if defined(CURVISPLAT_PAINT_CUT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CURVISPLAT_PAINT_CUT_INL_H
#undef CURVISPLAT_PAINT_CUT_INL_H
#else
#define CURVISPLAT_PAINT_CUT_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "render/cpu/paint_blocks-inl.h"
#include "render/cpu/paint_shade-inl.h"
#include "render/cpu/paint_visits-inl.h"
#include "render/cpu/tile.h"

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// The faces of a splat, over kReach deviations and the support's radius.
struct Faces {
  float at[ScreenCut::kFaces], by_p[ScreenCut::kFaces], by_q[ScreenCut::kFaces];
  bool far_side[ScreenCut::kFaces];
  int count;                 // the first of them; the others cut nothing
  float mean_per_deviation;  // the scalar's, along the ray
};

struct alignas(16) FourFloats {
  float of[4];
};

/// Holds the faces over a block: their values at its middle, and how far these change up to its outermost pixels.
/// The last of the four is no face.
struct BlockFaces {
  FourFloats at, by_x, by_y, spread;

  HWY_INLINE void set(const Faces& faces, const Ellipse& e) {
    constexpr float kHalf = 0.5f * (kBlockSide - 1);
    at = {ScreenCut::kNoFace, ScreenCut::kNoFace, ScreenCut::kNoFace, ScreenCut::kNoFace};
    by_x = by_y = spread = {};
    for (int n = 0; n < faces.count; ++n) {
      by_x.of[n] = faces.by_p[n] * e.a + faces.by_q[n] * e.b;
      by_y.of[n] = faces.by_q[n] * e.c;
      spread.of[n] = kHalf * (std::abs(by_x.of[n]) + std::abs(by_y.of[n]));
      at.of[n] = faces.at[n] + by_x.of[n] * (kHalf - e.x) + by_y.of[n] * (kHalf - e.y);
    }
  }
};
static_assert(ScreenCut::kFaces == 3);

/// Integrals of the biweight's distribution from 0 to x, |x| <= 1: of 1, of -32/5 x, and of x².
HWY_INLINE V massTo(V x, V x2) {
  const Floats d;
  return hn::Mul(
      x, hn::MulAdd(x2, hn::MulAdd(x2, hn::Set(d, 0.1875f), hn::Set(d, -0.625f)), hn::Set(d, 0.9375f)));
}
HWY_INLINE V firstTo(V x2) {
  const V rest = hn::Sub(hn::Set(Floats(), 1.0f), x2);
  return hn::Mul(hn::Mul(rest, rest), rest);
}
HWY_INLINE V secondTo(V x, V x2) {
  const Floats d;
  const V series =
      hn::MulAdd(x2, hn::MulAdd(x2, hn::Set(d, 0.9375f / 7), hn::Set(d, -0.375f)), hn::Set(d, 0.3125f));
  return hn::Mul(hn::Mul(x, x2), series);
}

/// The rest of some pixels along the ray: moments as those of an Interval.
struct Remaining {
  V share, mean, lost_variance;
};

/// The part of the pixels' depths that the faces leave: an interval of depths, over kReach deviations; so are
/// its moments.
struct Interval {
  V lo, hi;

  HWY_INLINE V share() const {
    return hn::Max(hn::Sub(massTo(hi, hn::Mul(hi, hi)), massTo(lo, hn::Mul(lo, lo))), hn::Zero(Floats()));
  }
  HWY_INLINE static V inverse(V share) {
    const Floats d;
    return hn::Div(hn::Set(d, 1.0f), hn::Max(share, hn::Set(d, 1e-6f)));
  }
  /// The mean depth. Slivers leave no digits of it: it is then held within them.
  HWY_INLINE V mean(V share) const {
    const V first = hn::Sub(firstTo(hn::Mul(hi, hi)), firstTo(hn::Mul(lo, lo)));
    return hn::Clamp(hn::Mul(hn::Mul(hn::Set(Floats(), -5.0f / 32), first), inverse(share)), lo, hi);
  }
  /// 1 less the variance in deviations, whose square is 7.
  HWY_INLINE V lostVariance(V share, V mean) const {
    const Floats d;
    const V second = hn::Sub(secondTo(hi, hn::Mul(hi, hi)), secondTo(lo, hn::Mul(lo, lo)));
    const V variance = hn::NegMulAdd(mean, mean, hn::Mul(second, inverse(share)));
    const V one = hn::Set(d, 1.0f);
    return hn::Sub(one, hn::Clamp(hn::Mul(hn::Set(d, 7.0f), variance), hn::Zero(d), one));
  }
  HWY_INLINE Remaining remaining(V share) const {
    const V middle = mean(share);
    return {share, middle, lostVariance(share, middle)};
  }
};

/// Moves the mean of a scalar at some pixels to that of what is left of the splat there. Returns the square of its half width.
/// `mean_per_deviation`: as that of Faces.
HWY_INLINE V narrow(const Scalar& scalar, float mean_per_deviation, const Remaining& left, V& mean) {
  const Floats d;
  mean = hn::MulAdd(hn::Set(d, mean_per_deviation * ScreenCut::kReach), left.mean, mean);
  const float lost = 3 * mean_per_deviation * mean_per_deviation;
  return hn::NegMulAdd(hn::Set(d, lost), left.lost_variance,
                       hn::Set(d, scalar.half_width * scalar.half_width));
}

/// A splat's ScreenDepth, as Faces are.
struct DepthLine {
  float middle = 0, by_p = 0, by_q = 0, per_depth = 0;
};

/// A window of depth in a block: [kBlockPixels] each, or null where it has no end.
struct DepthWindow {
  const float* HWY_RESTRICT nearer = nullptr;
  const float* HWY_RESTRICT farther = nullptr;
};

/// Holds what a splat hides of itself where that depends on what is left of it in each window: its `along`, and the
/// optical depth of its cell.
struct Hiding {
  float along = 0, tau = 0;

  /// How much nearer the scalar is seen, and by how much less the square of its half width is.
  HWY_INLINE void of(const Remaining& rest, V& nearer, V& lost) const {
    const Floats d;
    const V left = hn::Mul(rest.share, hn::Set(d, tau)), side = nearSide(left);
    const V kept = hn::Sub(hn::Set(d, 1.0f), rest.lost_variance);
    nearer = hn::Mul(hn::Mul(hn::Set(d, kSqrt3 * along), hn::Sqrt(kept)), side);
    lost = hn::Mul(hn::Mul(hn::Set(d, 3 * along * along), kept), lostByHiding(left, side));
  }
};

/// The cuts of a splat in a block.
struct Cuts {
  const Faces& faces;
  const DepthLine& depth;
  DepthWindow window;
  Hiding hiding = {};
};

HWY_INLINE Interval intervalAt(const Cuts& cuts, const Pixels& pixels, size_t lane) {
  const Floats d;
  const Faces& faces = cuts.faces;
  V lo = hn::Set(d, -1.0f), hi = hn::Set(d, 1.0f);
  for (int n = 0; n < faces.count; ++n) {
    const V a = hn::MulAdd(hn::Set(d, faces.by_p[n]), pixels.p,
                           hn::MulAdd(hn::Set(d, faces.by_q[n]), pixels.q, hn::Set(d, faces.at[n])));
    if (faces.far_side[n])
      lo = hn::Max(lo, hn::Neg(a));
    else
      hi = hn::Min(hi, a);
  }
  if (cuts.window.nearer || cuts.window.farther) {
    const DepthLine& line = cuts.depth;
    const V middle = hn::MulAdd(hn::Set(d, line.by_p), pixels.p,
                                hn::MulAdd(hn::Set(d, line.by_q), pixels.q, hn::Set(d, line.middle)));
    const V scale = hn::Set(d, line.per_depth);
    if (cuts.window.nearer)
      lo = hn::Max(lo, hn::Mul(hn::Sub(hn::Load(d, cuts.window.nearer + lane), middle), scale));
    if (cuts.window.farther)
      hi = hn::Min(hi, hn::Mul(hn::Sub(hn::Load(d, cuts.window.farther + lane), middle), scale));
  }
  lo = hn::Min(lo, hn::Set(d, 1.0f));
  return {lo, hn::Max(hi, lo)};
}

/// Says what the faces leave of a splat in a block; kSome where that is not known.
enum class Left { kNothing, kSome, kAll };

/// Most blocks of a large splat lie wholly on one side of each face.
HWY_INLINE Left leftIn(const BlockFaces& faces, Corner corner) {
  const Four d;
  const auto sure = hn::Set(d, 1.001f);
  bool all = true;
  for (size_t n = 0; n < 4; n += hn::Lanes(d)) {
    const auto spread = hn::Load(d, faces.spread.of + n);
    const auto at_left =
        hn::MulAdd(hn::Load(d, faces.by_y.of + n), hn::Set(d, corner.y), hn::Load(d, faces.at.of + n));
    const auto middle = hn::MulAdd(hn::Load(d, faces.by_x.of + n), hn::Set(d, corner.x), at_left);
    if (!hn::AllFalse(d, hn::Lt(hn::Add(middle, spread), hn::Neg(sure)))) return Left::kNothing;
    all = all && hn::AllTrue(d, hn::Gt(hn::Sub(middle, spread), sure));
  }
  return all ? Left::kAll : Left::kSome;
}

/// The shade of a splat that is cut: what is left of the depths moves s by `per_deviation` a deviation.
struct CutShade {
  Shade whole;
  float per_deviation;
  bool fitted;  // by a parabola
};

/// Blends what is left of a splat that is cut over a block: values_at(pixels, the interval that is left, its share, out).
template <typename ValuesAt>
HWY_INLINE void blendCut(const Ellipse& e, const Cuts& cuts, const float* HWY_RESTRICT footprint,
                         Corner corner, const ValuesAt& values_at, BlockColours& colours) {
  const Floats d;
  for (size_t v = 0; v < BlockColours::kVectors; ++v) {
    const size_t lane = v * hn::Lanes(d);
    const Pixels pixels = pixelsAt(e, corner, lane);
    if (pixels.areOutside()) continue;
    const Interval left = intervalAt(cuts, pixels, lane);
    const V share = left.share();
    if (hn::AllTrue(d, hn::Eq(share, hn::Zero(d)))) continue;
    V value[4];
    values_at(pixels, left, share, value);
    colours.blendUnder(v, hn::Mul(depthAt(e, footprint, pixels), share), value);
  }
}

/// Blends what is left of a splat of one parabola, or one colour.
HWY_INLINE void blendCut(const Ellipse& e, const Cuts& cuts, const float* HWY_RESTRICT footprint,
                         Corner corner, const CutShade& cut_shade, BlockColours& colours) {
  const Floats d;
  blendCut(
      e, cuts, footprint, corner,
      [&](const Pixels& pixels, const Interval& left, V share, V(&value)[4]) HWY_ATTR {
        const Shade& shade = cut_shade.whole;
        if (!cut_shade.fitted) return shade.valuesAt<false>(pixels, value);
        if (cut_shade.per_deviation == 0) return shade.valuesAt<true>(pixels, value);
        const V s = hn::MulAdd(left.mean(share), hn::Set(d, cut_shade.per_deviation), shade.s.at(pixels));
        for (int c = 0; c < 4; ++c)
          value[c] = hn::MulAdd(hn::MulAdd(hn::Set(d, shade.bend[c]), s, hn::Set(d, shade.by[c])), s,
                                hn::Set(d, shade.at[c]));
      },
      colours);
}

/// Looks up the colours of a splat that is cut. Returns whether anything is left of it in the block.
HWY_INLINE bool lookUpBlock(const Ellipse& e, const Scalar& scalar, const Cuts& cuts, const Tables& tables,
                            Corner corner, LookedUp& out) {
  const Floats d;
  const float* HWY_RESTRICT footprint = tables.footprint;
  const Faces& faces = cuts.faces;
  Intervals intervals, nearer;
  const bool hides = scalar.nearer != 0, by_window = cuts.hiding.along != 0;
  const float hidden2 =
      scalar.half_width * scalar.half_width - scalar.seen_half_width * scalar.seen_half_width;
  out.touched = 0;
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const Pixels pixels = pixelsAt(e, corner, lane);
    if (pixels.areOutside()) continue;
    const Interval left = intervalAt(cuts, pixels, lane);
    const V share = left.share(), depth = hn::Mul(depthAt(e, footprint, pixels), share);
    const uint32_t touched = bitsOf(hn::Gt(depth, hn::Zero(d)));
    if (touched == 0) continue;
    out.touched |= touched << lane;
    hn::Store(depth, d, out.depth.at + lane);
    V mean = scalar.meanAt(pixels);
    V half_width = hn::Set(d, scalar.half_width), seen_half_width = hn::Set(d, scalar.seen_half_width);
    V by = hn::Set(d, scalar.nearer);
    if (faces.mean_per_deviation != 0 || by_window) {
      const Remaining rest = left.remaining(share);
      const V width2 = narrow(scalar, faces.mean_per_deviation, rest, mean);
      V narrower = hn::Set(d, hidden2);
      if (by_window) cuts.hiding.of(rest, by, narrower);
      half_width = hn::Sqrt(hn::Max(width2, hn::Zero(d)));
      seen_half_width = hn::Sqrt(hn::Max(hn::Sub(width2, narrower), hn::Zero(d)));
    }
    locate(tables.shading, mean, half_width, lane, intervals);
    hn::Store(hn::Load(d, intervals.scale.at + lane), d, out.scale.at + lane);
    if (hides) locate(tables.shading, hn::Sub(mean, by), seen_half_width, lane, nearer);
  }
  if (out.touched == 0) return false;
  out.integrate(tables.shading, intervals);
  if (hides) showNearSides(tables.shading, nearer, out);
  return true;
}

/// Paints a block's windows, from the nearest on: paint(where, window) says whether the window is saturated then.
/// Whether nothing behind the first can be seen any more.
template <typename Paint>
HWY_INLINE bool paintWindows(const TileWork& work, int block, const Paint& paint) {
  TileWindows& windows = *work.windows;
  uint8_t& open = windows.open[static_cast<size_t>(block)];
  const float* depths = windows.depths + block * kBlockPixels;
  constexpr int kPixels = kTileSide * kTileSide;
  for (int n = 0; n < open; ++n) {
    DepthWindow window;
    if (n > 0) window.nearer = depths + (n - 1) * kPixels;
    if (n < windows.layers) window.farther = depths + n * kPixels;
    float* const at = n == 0 ? work.tile : windows.behind + (n - 1) * kTileFloats;
    if (paint(at + block * kBlockFloats, window)) open = static_cast<uint8_t>(n);
  }
  return open == 0;
}

HWY_INLINE Faces facesOf(const ScreenSplat* record) {
  const ScreenCut cut = record ? ScreenCut::of(*record) : ScreenCut{};
  Faces faces;
  faces.count = 0;
  for (size_t face = 0; face < ScreenCut::kFaces; ++face) {
    faces.at[face] = cut.faces[face][0] * (1 / ScreenCut::kReach);
    faces.by_p[face] = cut.faces[face][1] * (kSupport / ScreenCut::kReach);
    faces.by_q[face] = cut.faces[face][2] * (kSupport / ScreenCut::kReach);
    faces.far_side[face] = (cut.far_sides >> face & 1) != 0;
    const auto& [at, by0, by1] = cut.faces[face];
    if (at != ScreenCut::kNoFace || by0 != 0 || by1 != 0) faces.count = static_cast<int>(face) + 1;
  }
  faces.mean_per_deviation = cut.correlation;
  return faces;
}

HWY_INLINE DepthLine depthLineOf(const ScreenSplat* record) {
  if (!record) return {};
  const ScreenDepth depth = ScreenDepth::of(*record);
  return {depth.middle, kSupport * depth.by[0], kSupport * depth.by[1],
          depth.per_depth * (1 / ScreenCut::kReach)};
}

/// A splat that is cut, with all that its blocks need.
struct CutSplat {
  Ellipse e;
  Scalar scalar;
  Faces faces;
  BlockFaces block_faces;
  DepthLine line;
  CutShade shade;
  Hiding hiding;
  Lit lit;
  Fit fit;        // kOther: every pixel is looked up
  bool windowed;  // it is painted in each window of its pixels

  HWY_INLINE bool isLookedUp() const { return fit == kOther && !windowed; }
};

/// `number`: in the splats of the tile.
HWY_INLINE void makeCut(const TileWork& work, const Visit& visit, size_t number, CutSplat& out) {
  const ScreenSplat& splat = work.splats[number];
  const SplatRecords records = SplatRecords::beside(&splat, -1, false);
  out.e = visit.ellipse();
  out.lit = visit.all.lit(work, visit.n);
  out.faces = facesOf(records.cut);
  out.block_faces.set(out.faces, out.e);
  out.line = depthLineOf(records.depth);
  if (records.depth) out.faces.mean_per_deviation = ScreenDepth::of(*records.depth).correlation;
  out.windowed = records.depth && work.windows;
  Scalar& scalar = out.scalar = visit.scalar();
  out.faces.mean_per_deviation *= scalar.half_width * (1 / kSqrt3);
  if (work.shading.per_pixel)
    scalar.reach = kSupport * std::sqrt(splat.slope0 * splat.slope0 + splat.slope1 * splat.slope1);
  // On a logarithmic scale there is no bound of what a narrower distribution sees.
  const bool narrower = out.faces.mean_per_deviation != 0;
  const bool hides = records.depth && scalar.nearer != 0;
  out.fit = hides || (work.table.logScale() && work.shading.per_pixel && narrower)
                ? kOther
                : static_cast<Fit>(visit.fit());
  out.hiding = {};
  if (hides) out.hiding = {splat.along, visit.all.cell_depth.at[visit.n] * visit.fits.at.of[3].at[visit.n]};
  if (out.fit == kOther) return;
  const float inverse = 1 / std::max(visit.all.pieces.reach.at[visit.n], 1e-37f);
  out.shade = {shadeOf(visit.fits, visit.n), inverse * out.faces.mean_per_deviation * ScreenCut::kReach,
               out.fit == kParabola};
  out.shade.whole.s = narrower
                          ? Along{0, inverse * scalar.reach * scalar.tp, inverse * scalar.reach * scalar.tq}
                          : along(visit.all.pieces, visit.n, scalar, -1, 1);
}

/// Looks up a splat whose pixels have to be. Returns whether anything is left of it in the block.
HWY_INLINE bool lookUpCut(const TileWork& work, const CutSplat& cut, const float* footprint, int block,
                          LookedUp& out) {
  const Tables tables{work.table, footprint};
  const Corner corner = cornerOf(block);
  const Left left = leftIn(cut.block_faces, corner);
  if (left == Left::kNothing) return false;
  if (left == Left::kAll) return lookUpBlock(cut.e, cut.scalar, tables, corner, out);
  return lookUpBlock(cut.e, cut.scalar, Cuts{cut.faces, cut.line, {}, cut.hiding}, tables, corner, out);
}

/// Blends a splat that is fitted, and not windowed, over a block.
HWY_INLINE void blendFitted(const CutSplat& cut, const float* footprint, int block, BlockColours& colours) {
  const Corner corner = cornerOf(block);
  const Left left = leftIn(cut.block_faces, corner);
  if (left == Left::kAll) blendOver(cut.e, footprint, corner, cut.shade.whole, cut.shade.fitted, colours);
  if (left == Left::kSome) blendCut(cut.e, {cut.faces, cut.line, {}}, footprint, corner, cut.shade, colours);
}

/// Blends a splat that has lines, and is not windowed, over a block. The depths that are left do not move its scalar.
HWY_INLINE void blendLines(const CutSplat& cut, const Lines& lines, const float* footprint, int block,
                           BlockColours& colours) {
  const Corner corner = cornerOf(block);
  const Left left = leftIn(cut.block_faces, corner);
  const Along& s = cut.shade.whole.s;
  if (left == Left::kAll) blendOver(cut.e, footprint, corner, s, lines, colours);
  if (left == Left::kSome)
    blendCut(
        cut.e, {cut.faces, cut.line, {}}, footprint, corner,
        [&](const Pixels& pixels, const Interval&, V, V(&value)[4])
            HWY_ATTR { lines.valuesAt(s.at(pixels), value); },
        colours);
}

/// Paints one block of a splat that is windowed. Returns whether it is saturated then.
HWY_NOINLINE bool paintWindowed(const TileWork& work, const CutSplat& cut, const float* footprint,
                                int block) {
  const Corner corner = cornerOf(block);
  if (leftIn(cut.block_faces, corner) == Left::kNothing) return false;
  return paintWindows(work, block, [&](float* at, const DepthWindow& window) HWY_ATTR {
    const Cuts cuts{cut.faces, cut.line, window, cut.hiding};
    if (cut.fit != kOther)
      return paintBlock(at, [&](BlockColours& colours)
                                HWY_ATTR { blendCut(cut.e, cuts, footprint, corner, cut.shade, colours); });
    LookedUp looked_up;
    return lookUpBlock(cut.e, cut.scalar, cuts, {work.table, footprint}, corner, looked_up) &&
           paintLookedUp(looked_up, cut.lit, at);
  });
}

/// Whether lines may do for the splat.
HWY_INLINE bool mayHaveLines(const Visit& visit, const CutSplat& cut) {
  return cut.isLookedUp() && cut.faces.mean_per_deviation == 0 && cut.hiding.along == 0 &&
         mayHaveLines(visit);
}

/// Returns those of `blocks` that are saturated then.
HWY_NOINLINE BlockMask paintCut(const TileWork& work, BlockMask blocks, const Visit& visit, size_t number,
                                const float* footprint) {
  CutSplat cut;
  makeCut(work, visit, number, cut);
  if (cut.windowed)
    return paintBlocks(blocks,
                       [&](int block) HWY_ATTR { return paintWindowed(work, cut, footprint, block); });
  if (cut.fit != kOther)
    return blendBlocks(work, blocks, [&](int block, BlockColours& colours) HWY_ATTR {
      blendFitted(cut, footprint, block, colours);
    });
  Lines lines;
  if (mayHaveLines(visit, cut) && fitLines(work, visit, lines)) {
    cut.shade.whole.s = alongLines(visit);
    return blendBlocks(work, blocks, [&](int block, BlockColours& colours) HWY_ATTR {
      blendLines(cut, lines, footprint, block, colours);
    });
  }
  return paintLookedUpBlocks(work, blocks, cut.lit, [&](int block, LookedUp& out) HWY_ATTR {
    return lookUpCut(work, cut, footprint, block, out);
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#endif
