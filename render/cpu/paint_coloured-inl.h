// Blends splats of two scalars: the opacity is one's, the colours are another's. Along the ray both are taken for
// independent: the mean colour over the one's interval, times the mean extinction over the other's. Included once for
// every instruction set.
#if defined(CURVISPLAT_PAINT_COLOURED_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CURVISPLAT_PAINT_COLOURED_INL_H
#undef CURVISPLAT_PAINT_COLOURED_INL_H
#else
#define CURVISPLAT_PAINT_COLOURED_INL_H
#endif

#include <hwy/highway.h>

#include <cmath>

#include "render/cpu/paint_blocks-inl.h"
#include "render/cpu/paint_cut-inl.h"
#include "render/cpu/paint_shade-inl.h"
#include "render/cpu/paint_visits-inl.h"
#include "render/cpu/tile.h"

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// The colours of sixteen splats: how their scalar goes all over each, and what does for it.
struct ColourVisits {
  Row tp, tq;
  Row slope_reach;  // of the slope alone; that of `pieces` has what cuts move the mean by as well
  Row correlation;
  Row mean, half_width, along,
      tau;  // of the whole splat, and what it hides of itself; `pieces` have what is seen
  Pieces pieces;
  Fits fits{};

  HWY_INLINE Scalar scalar(size_t n) const {
    return {pieces.mean.at[n], slope_reach.at[n], tp.at[n], tq.at[n], pieces.half_width.at[n]};
  }
};

/// Sets up the colours from the ScreenColours beside the splats with these numbers.
HWY_INLINE void setUpColours(const TileWork& work, const IntRow& numbers, const Visits& visits,
                             const Fits& opacity, size_t count, ColourVisits& out) {
  constexpr int32_t kFloats = sizeof(ScreenSplat) / sizeof(float);
  const Floats d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), support = hn::Set(d, kSupport);
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const auto store = [&](V value, Row& row) HWY_ATTR { hn::Store(value, d, row.at + lane); };
    const auto beside = hn::Sub(hn::Load(Ints(), numbers.at + lane), hn::Set(Ints(), 1));
    const auto offsets = hn::Mul(beside, hn::Set(Ints(), kFloats));
    const V mean = gather(work, offsets, 0);
    hn::Store(hn::Load(d, visits.pieces.amplitude.at + lane), d, out.pieces.amplitude.at + lane);
    store(hn::Neg(one), out.pieces.from);
    store(one, out.pieces.to);
    if (!work.shading.per_pixel) {
      store(mean, out.pieces.mean);
      for (Row* row : {&out.tp, &out.tq, &out.slope_reach, &out.correlation, &out.pieces.reach, &out.along,
                       &out.pieces.half_width, &out.pieces.width_loss})
        store(zero, *row);
      continue;
    }
    const V slope0 = gather(work, offsets, 1), slope1 = gather(work, offsets, 3);
    // What is seen of a splat is nearer than its middle, all over it by the opacity there.
    const V along = gather(work, offsets, 5), all = gather(work, offsets, 4);
    const V tau = hn::Mul(hn::Load(d, visits.cell_depth.at + lane), hn::Load(d, opacity.at.of[3].at + lane));
    const V near_side = nearSide(tau), nearer = hn::Mul(hn::Mul(hn::Set(d, kSqrt3), along), near_side);
    const auto hides =
        hn::Gt(hn::Mul(hn::Abs(nearer), cellsAScalar(*work.colours, mean)), hn::Set(d, kHidingCells));
    store(hn::IfThenElse(hides, hn::Sub(mean, nearer), mean), out.pieces.mean);
    store(mean, out.mean);
    store(all, out.half_width);
    store(hn::IfThenElseZero(hides, along), out.along);
    store(tau, out.tau);
    const V lost = hn::Mul(hn::Mul(hn::Set(d, 3.0f), hn::Mul(along, along)), lostByHiding(tau, near_side));
    const V narrower = hn::Sqrt(hn::Max(hn::MulSub(all, all, lost), zero));
    const V half_width = hn::IfThenElse(hides, narrower, all);
    const V correlation = hn::Sub(hn::Neg(gather(work, offsets, 2)), hn::Set(d, kColourTag));
    const V slope = hn::Sqrt(hn::MulAdd(slope0, slope0, hn::Mul(slope1, slope1)));
    const V inverse = hn::Div(one, hn::Max(slope, hn::Set(d, 1e-37f)));
    store(hn::Mul(slope0, inverse), out.tp);
    store(hn::Mul(slope1, inverse), out.tq);
    store(half_width, out.pieces.half_width);
    store(correlation, out.correlation);
    store(hn::Mul(support, slope), out.slope_reach);
    // How far cuts move the mean, and how much narrower they make the distribution, as in setUp().
    const V cut = hn::Load(d, visits.cut.at + lane);
    const V moved = hn::Mul(hn::Mul(hn::Abs(correlation), half_width), hn::Set(d, kReachOfHalfWidth));
    const V kept = hn::Sqrt(hn::Max(hn::NegMulAdd(correlation, correlation, one), zero));
    store(hn::MulAdd(cut, moved, hn::Mul(support, slope)), out.pieces.reach);
    store(hn::Mul(cut, hn::Mul(half_width, hn::Sub(one, kept))), out.pieces.width_loss);
  }
  if (work.shading.per_pixel)
    fitPieces(*work.colours, out.pieces, count, out.fits);
  else
    fitMeans(*work.colours, out.pieces, count, out.fits);
}

/// Splat n of sixteen.
struct ColouredSplat {
  const Visits& visits;
  const Fits& fits;
  const ColourVisits& colours;
  size_t n;
};

/// One of the two scalars of a splat, and what it makes of its pixels.
struct Channel {
  const ShadingTable& table;
  Scalar scalar;             // with the reach of the slope alone
  float mean_per_deviation;  // as that of Faces
  bool looked_up;
  Hiding hiding;            // by windows
  Shade shade;              // else; s is 0 at the mean
  float per_deviation;      // of s
  int first = 0, last = 3;  // of the table's values
  LookedUp pixels = {};     // where they are looked up
  Row values[4] = {};       // where they are not
};

HWY_INLINE Channel channelOf(const ShadingTable& table, const Fits& fits, size_t n, const Scalar& scalar,
                             float correlation, float piece_reach) {
  Channel channel{table,
                  scalar,
                  correlation * scalar.half_width * (1 / kSqrt3),
                  fits.fit.at[n] == kOther,
                  {},
                  shadeOf(fits, n),
                  0};
  const float inverse = 1 / std::max(piece_reach, 1e-37f);
  channel.shade.s = {0, inverse * scalar.reach * scalar.tp, inverse * scalar.reach * scalar.tq};
  channel.per_deviation = inverse * channel.mean_per_deviation * ScreenCut::kReach;
  if (fits.fit.at[n] == kConstant)
    for (int c = 0; c < 4; ++c) channel.shade.by[c] = channel.shade.bend[c] = 0;
  return channel;
}

HWY_INLINE void evaluate(Channel& channel, const Pixels& pixels, const Remaining& left, size_t lane,
                         Intervals& intervals) {
  const Floats d;
  if (channel.looked_up) {
    V mean = channel.scalar.meanAt(pixels);
    V width2 = narrow(channel.scalar, channel.mean_per_deviation, left, mean);
    if (channel.hiding.along != 0) {
      V nearer, narrower;
      channel.hiding.of(left, nearer, narrower);
      mean = hn::Sub(mean, nearer);
      width2 = hn::Sub(width2, narrower);
    }
    locate(channel.table, mean, hn::Sqrt(hn::Max(width2, hn::Zero(d))), lane, intervals);
    hn::Store(hn::Load(d, intervals.scale.at + lane), d, channel.pixels.scale.at + lane);
    return;
  }
  const Shade& shade = channel.shade;
  const V s = hn::MulAdd(left.mean, hn::Set(d, channel.per_deviation), shade.s.at(pixels));
  for (int c = channel.first; c <= channel.last; ++c)
    hn::Store(hn::MulAdd(hn::MulAdd(hn::Set(d, shade.bend[c]), s, hn::Set(d, shade.by[c])), s,
                         hn::Set(d, shade.at[c])),
              d, channel.values[c].at + lane);
}

HWY_INLINE void valuesAt(const Channel& channel, size_t lane, V (&value)[4]) {
  const Floats d;
  if (channel.looked_up)
    meansOf(channel.pixels.integrals, hn::Load(d, channel.pixels.scale.at + lane), lane, value);
  else
    for (int c = channel.first; c <= channel.last; ++c) value[c] = hn::Load(d, channel.values[c].at + lane);
}

/// A splat of two scalars.
struct Coloured {
  Ellipse e;
  Faces faces;
  DepthLine line;
  bool is_cut;
  Lit lit;
  Channel opacity, colour;
};

/// One block. Whether it is saturated now.
HWY_NOINLINE bool paintBlock(Coloured& splat, const DepthWindow& window, const float* HWY_RESTRICT footprint,
                             float* HWY_RESTRICT block, Corner corner) {
  const Floats d;
  const Cuts cuts{splat.faces, splat.line, window};
  Intervals of_opacity, of_colour;
  Row depths;
  V deepest = hn::Zero(d);
  for (size_t lane = 0; lane < kBlockPixels; lane += hn::Lanes(d)) {
    const Pixels pixels = pixelsAt(splat.e, corner, lane);
    V depth = depthAt(splat.e, footprint, pixels);
    Remaining left{hn::Set(d, 1.0f), hn::Zero(d), hn::Zero(d)};
    if (splat.is_cut) {
      const Interval interval = intervalAt(cuts, pixels, lane);
      const V share = interval.share();
      depth = hn::Mul(depth, share);
      left = interval.remaining(share);
    }
    deepest = hn::Max(deepest, depth);
    hn::Store(depth, d, depths.at + lane);
    evaluate(splat.opacity, pixels, left, lane, of_opacity);
    evaluate(splat.colour, pixels, left, lane, of_colour);
  }
  if (hn::AllTrue(d, hn::Eq(deepest, hn::Zero(d)))) return false;
  if (splat.opacity.looked_up)
    integrate(splat.opacity.table, of_opacity, kLanes, splat.opacity.pixels.integrals);
  if (splat.colour.looked_up) integrate(splat.colour.table, of_colour, kLanes, splat.colour.pixels.integrals);
  V most = hn::Zero(d);
  for (size_t lane = 0; lane < kBlockPixels; lane += hn::Lanes(d)) {
    V of_table[4], value[4];
    valuesAt(splat.opacity, lane, of_table);
    const V extinction = hn::Max(of_table[3], hn::Zero(d));
    valuesAt(splat.colour, lane, value);
    const V coloured = hn::Mul(extinction, hn::Set(d, splat.lit.diffuse));
    const V white = hn::Mul(extinction, hn::Set(d, splat.lit.specular));
    for (int c = 0; c < 3; ++c) value[c] = hn::MulAdd(hn::Max(value[c], hn::Zero(d)), coloured, white);
    value[3] = extinction;
    most = hn::Max(most, blendUnder(block + lane, hn::Load(d, depths.at + lane), value));
  }
  return isSaturated(most);
}

/// The splat has the number `number`. Returns those of `blocks` that are saturated then.
HWY_NOINLINE BlockMask paintColoured(const TileWork& work, BlockMask blocks, const ColouredSplat& at,
                                     size_t number, const float* footprint) {
  const ScreenSplat& record = work.splats[number];
  const size_t n = at.n;
  const SplatRecords records = SplatRecords::beside(&record, -1, true);
  Scalar scalar = at.visits.scalar(n);
  // That of the visit has what cuts move the mean by as well, and its s is of a part of the splat.
  const float piece_reach = scalar.reach;
  scalar.reach = work.shading.per_pixel
                     ? kSupport * std::sqrt(record.slope0 * record.slope0 + record.slope1 * record.slope1)
                     : 0;
  float correlation = 0;
  if (records.depth)
    correlation = ScreenDepth::of(*records.depth).correlation;
  else if (records.cut)
    correlation = ScreenCut::of(*records.cut).correlation;
  const ColourVisits& colours = at.colours;
  Scalar of_colour = colours.scalar(n);
  Hiding hiding;
  if (records.depth && colours.along.at[n] != 0) {
    of_colour.mean = colours.mean.at[n];
    of_colour.half_width = colours.half_width.at[n];
    hiding = {colours.along.at[n], colours.tau.at[n]};
  }
  Coloured splat{at.visits.ellipse(n),
                 facesOf(records.cut),
                 depthLineOf(records.depth),
                 records.cut || records.depth,
                 at.visits.lit(work, n),
                 channelOf(work.table, at.fits, n, scalar, correlation, piece_reach),
                 channelOf(*work.colours, colours.fits, n, of_colour, colours.correlation.at[n],
                           colours.pieces.reach.at[n])};
  splat.colour.hiding = hiding;
  splat.colour.looked_up |= hiding.along != 0;
  splat.opacity.first = 3;
  splat.colour.last = 2;
  const float from = at.visits.pieces.from.at[n], to = at.visits.pieces.to.at[n];
  const float per_t = 2 / std::max(to - from, 1e-37f);
  Shade& shade = splat.opacity.shade;
  shade.s = {-1 - from * per_t, shade.s.sp * per_t, shade.s.sq * per_t};
  splat.opacity.per_deviation *= per_t;
  // On a logarithmic scale there is no bound of what a narrower distribution sees.
  if (splat.is_cut && work.shading.per_pixel)
    for (Channel* channel : {&splat.opacity, &splat.colour}) channel->looked_up |= channel->table.logScale();

  const bool windowed = records.depth && work.windows;
  BlockMask saturated = 0;
  while (blocks != 0) {
    const int block = takeFirst(blocks);
    const auto in_window = [&](float* at_block, const DepthWindow& window) HWY_ATTR {
      return paintBlock(splat, window, footprint, at_block, cornerOf(block));
    };
    if (windowed ? paintWindows(work, block, in_window) : in_window(work.tile + block * kBlockFloats, {}))
      saturated |= BlockMask{1} << block;
  }
  return saturated;
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#endif
