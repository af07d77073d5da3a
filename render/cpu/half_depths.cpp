#include "render/cpu/half_depths.h"

#include <algorithm>
#include <cmath>

#include "render/cpu/tile.h"
#include "render/project/footprint.h"

// The code from here to HWY_AFTER_NAMESPACE is compiled once for every instruction set that a processor may
// have.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/half_depths.cpp"
#include <hwy/foreach_target.h>  // before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, 8>;
using Whole = hn::RebindToUnsigned<Doubles>;
using V = hn::Vec<Doubles>;

/// The biweight's share below x deviations.
HWY_INLINE V shareBelow(V x) {
  const Doubles d;
  constexpr double kPerReach = 0.3779644730092272;  // 1 / √7
  const V one = hn::Set(d, 1.0);
  const V y = hn::Max(hn::Set(d, -1.0), hn::Min(one, hn::Mul(x, hn::Set(d, kPerReach))));
  const V y2 = hn::Mul(y, y);
  const V cubic = hn::MulAdd(y2, hn::Set(d, 0.1875), hn::Set(d, -0.625));
  return hn::MulAdd(y, hn::MulAdd(y2, cubic, hn::Set(d, 0.9375)), hn::Set(d, 0.5));
}

HWY_INLINE V leftByFaces(const ScreenCut& cut, V u0, V u1) {
  const Doubles d;
  V low = hn::Set(d, -double{ScreenCut::kReach}), high = hn::Set(d, double{ScreenCut::kReach});
  for (size_t n = 0; n < ScreenCut::kFaces; ++n) {
    const auto& face = cut.faces[n];
    const V a = hn::MulAdd(hn::Set(d, double{face[2]}), u1,
                           hn::MulAdd(hn::Set(d, double{face[1]}), u0, hn::Set(d, double{face[0]})));
    if (cut.far_sides >> n & 1)
      low = hn::Max(low, hn::Neg(a));
    else
      high = hn::Min(high, a);
  }
  return hn::Max(hn::Zero(d), hn::Sub(shareBelow(high), shareBelow(low)));
}

HWY_INLINE V skewAt(const FootprintSkew& skew, V u0, V u1) {
  const Doubles d;
  const V per_sigma = hn::Set(d, 1 / kKernelSigma);
  const V v0 = hn::Mul(u0, per_sigma), v1 = hn::Mul(u1, per_sigma);
  const auto t = [&](size_t n) HWY_ATTR { return hn::Set(d, double{skew.t[n]}); };
  // t0 v0³ + 3 t1 v0² v1 + 3 t2 v0 v1² + t3 v1³ - 3 ((t0 + t2) v0 + (t1 + t3) v1)
  const V three = hn::Set(d, 3.0);
  const V mixed = hn::Mul(three, hn::MulAdd(t(1), v0, hn::Mul(t(2), v1)));
  const V cubic =
      hn::MulAdd(hn::Mul(v0, v1), mixed,
                 hn::MulAdd(hn::Mul(t(0), hn::Mul(v0, v0)), v0, hn::Mul(t(3), hn::Mul(v1, hn::Mul(v1, v1)))));
  const V linear = hn::MulAdd(hn::Add(t(0), t(2)), v0, hn::Mul(hn::Add(t(1), t(3)), v1));
  const V sum = hn::Sub(cubic, hn::Mul(three, linear));
  return hn::Max(hn::Zero(d), hn::MulAdd(sum, hn::Set(d, 1.0 / 6), hn::Set(d, 1.0)));
}

/// The integral of extinction up to x cells.
HWY_INLINE V integralTo(const MeanExtinction& extinction, V x) {
  const Doubles d;
  const hn::RebindToSigned<Doubles> di;
  constexpr double kCells = ClassificationTable::kCells, kShift = 6755399441055744.0;  // 1.5 * 2^52
  const V minus_one = hn::Set(d, -1.0);
  // What is not a number is before the first cell: the places to gather from exist for any splat of a damaged cache.
  const V cell = hn::IfThenElse(hn::Ge(x, minus_one), hn::Min(hn::Set(d, kCells), hn::Floor(x)), minus_one);
  // Numbers from -1 on as the lowest bits of a double.
  const auto number =
      hn::Sub(hn::BitCast(di, hn::Add(cell, hn::Set(d, kShift))), hn::BitCast(di, hn::Set(d, kShift)));
  const V begin = hn::GatherIndex(d, extinction.begins(), number);
  const V slope = hn::GatherIndex(d, extinction.slopes(), number);
  return hn::MulAdd(slope, hn::Sub(x, hn::Max(cell, hn::Zero(d))), begin);
}

HWY_INLINE V extinctionAt(const MeanExtinction& extinction, V scalar, double half_width) {
  const Doubles d;
  V from, to;
  if (extinction.isLinear()) {
    const V middle = hn::MulAdd(scalar, hn::Set(d, extinction.scale()), hn::Set(d, extinction.bias()));
    const V half = hn::Set(d, std::max(0.5, half_width * extinction.scale()));
    from = hn::Sub(middle, half);
    to = hn::Add(middle, half);
  } else {
    HWY_ALIGN double low[8], high[8];
    hn::Store(scalar, d, low);
    for (size_t n = 0; n < hn::Lanes(d); ++n) {
      const double middle = low[n];
      low[n] = extinction.inCells(middle - half_width);
      high[n] = extinction.inCells(middle + half_width);
      if (high[n] - low[n] >= 1) continue;
      low[n] = 0.5 * (low[n] + high[n]) - 0.5;
      high[n] = low[n] + 1;
    }
    from = hn::Load(d, low);
    to = hn::Load(d, high);
  }
  const V all = hn::Sub(integralTo(extinction, to), integralTo(extinction, from));
  return hn::Max(hn::Zero(d), hn::Div(all, hn::Sub(to, from)));
}

void addToHalf(const HalfSplat& splat, const HalfBox& box, const MeanExtinction& extinction, HalfTile& tile,
               HalfEvents& events) {
  const Doubles d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  constexpr double kSupport2 = kKernelSupport * kKernelSupport;
  const float* const footprint = footprintPolynomial();
  const V found = hn::Set(d, HalfTile::kFound), one = hn::Set(d, 1.0);
  HWY_ALIGN double distances[8], parts[8];
  HWY_ALIGN uint64_t chosen[8];
  // Calls for the lanes of a mask.
  const auto forLanes = [&](hn::Mask<Doubles> mask, const auto& call) HWY_ATTR {
    const Whole du;
    hn::Store(hn::IfThenElseZero(hn::RebindMask(du, mask), hn::Set(du, 1)), du, chosen);
    for (size_t n = 0; n < hn::Lanes(d); ++n)
      if (chosen[n]) call(n);
  };
  const int first = (box.x0 - box.tile_x) / lanes * lanes, last = box.x1 - box.tile_x;
  for (int y = box.y0; y <= box.y1; ++y)
    for (int column = first; column <= last; column += lanes) {
      const size_t at = static_cast<size_t>(y - box.tile_y) * kTileSide + static_cast<size_t>(column);
      const V target = hn::Load(d, tile.target.data() + at);
      const V x = hn::Add(hn::Set(d, box.tile_x + column + 0.5 - splat.x), hn::Iota(d, 0));
      const V u0 = hn::Mul(x, hn::Set(d, splat.per_l11));
      const V u1 = hn::Mul(hn::NegMulAdd(hn::Set(d, splat.l21), u0, hn::Set(d, y + 0.5 - splat.y)),
                           hn::Set(d, splat.per_l22));
      const V rho2 = hn::MulAdd(u0, u0, hn::Mul(u1, u1));
      auto open = hn::And(hn::Lt(rho2, hn::Set(d, kSupport2)), hn::Lt(target, found));
      const V of_box = hn::Add(hn::Set(d, box.tile_x + column), hn::Iota(d, 0));
      open = hn::And(open, hn::And(hn::Ge(of_box, hn::Set(d, box.x0)), hn::Le(of_box, hn::Set(d, box.x1))));
      if (hn::AllFalse(d, open)) continue;
      const V inner = hn::NegMulAdd(rho2, hn::Set(d, 1 / kSupport2), one);
      V sum = hn::Set(d, double{footprint[kFootprintTerms - 1]});
      for (int n = kFootprintTerms - 2; n >= 0; --n)
        sum = hn::MulAdd(sum, inner, hn::Set(d, double{footprint[n]}));
      V thickness = hn::Mul(hn::Mul(hn::Set(d, splat.amplitude), sum), hn::Mul(inner, inner));
      if (splat.cut) thickness = hn::Mul(thickness, leftByFaces(*splat.cut, u0, u1));
      if (splat.skew) thickness = hn::Mul(thickness, skewAt(*splat.skew, u0, u1));
      const V scalar = hn::MulAdd(hn::Set(d, splat.slope0), u0,
                                  hn::MulAdd(hn::Set(d, splat.slope1), u1, hn::Set(d, splat.mean)));
      const V added = hn::Mul(thickness, extinctionAt(extinction, scalar, splat.half_width));
      open = hn::And(open, hn::Gt(added, hn::Zero(d)));
      if (hn::AllFalse(d, open)) continue;
      const V distance = hn::MulAdd(
          hn::Set(d, double{splat.depth.by[0]}), u0,
          hn::MulAdd(hn::Set(d, double{splat.depth.by[1]}), u1, hn::Set(d, double{splat.depth.middle})));
      const auto behind = hn::And(open, hn::Lt(hn::Load(d, tile.next_layer.data() + at), distance));
      if (!hn::AllFalse(d, behind)) {
        hn::Store(distance, d, distances);
        forLanes(behind, [&](size_t n) { events.passLayers(at + n, distances[n]); });
        open = hn::And(open, hn::Lt(hn::Load(d, tile.target.data() + at), found));
      }
      const V before = hn::Load(d, tile.depth.data() + at);
      const V after = hn::Add(before, hn::IfThenElseZero(open, added));
      hn::Store(after, d, tile.depth.data() + at);
      const auto reached = hn::And(open, hn::Ge(after, target));
      if (hn::AllFalse(d, reached)) continue;
      hn::Store(hn::Div(hn::Sub(target, before), added), d, parts);
      forLanes(reached, [&](size_t n) { events.reach(at + n, parts[n]); });
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(addToHalf);

void addToHalf(const HalfSplat& splat, const HalfBox& box, const MeanExtinction& extinction, HalfTile& tile,
               HalfEvents& events) {
  HWY_DYNAMIC_DISPATCH(addToHalf)(splat, box, extinction, tile, events);
}

MeanExtinction::MeanExtinction(const ClassificationTable& table)
    : log_scale_(table.logScale()), scale_(table.scale()), bias_(table.bias()) {
  const auto cumulative = table.exactCumulative();
  begins_.push_back(0);
  slopes_.push_back(table.below().w);
  for (size_t n = 0; n + 1 < cumulative.size(); ++n) {
    begins_.push_back(cumulative[n].w);
    slopes_.push_back(cumulative[n + 1].w - cumulative[n].w);
  }
  begins_.push_back(cumulative.back().w);
  slopes_.push_back(table.above().w);
}

double MeanExtinction::inCells(double scalar) const {
  constexpr double kMin = ClassificationTable::kMinLogarithmic;
  return scale_ * (log_scale_ ? std::log(std::max(scalar, kMin)) : scalar) + bias_;
}

}  // namespace curvisplat
#endif
