// What a splat's pixels see of the transfer function, over a piece of the splat: a colour, a parabola along
// the scalar's slope, or every pixel for itself. Included once for every instruction set.
#if defined(CURVISPLAT_PAINT_SHADE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CURVISPLAT_PAINT_SHADE_INL_H
#undef CURVISPLAT_PAINT_SHADE_INL_H
#else
#define CURVISPLAT_PAINT_SHADE_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/tile.h"

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Sixteen of something at a time: splats, blocks or pixels. In one vector or in several.
constexpr size_t kLanes = 16;
using Floats = hn::CappedTag<float, kLanes>;
using Ints = hn::RebindToSigned<Floats>;
using Four = hn::CappedTag<float, 4>;
using V = hn::Vec<Floats>;

struct alignas(64) Row {
  float at[kLanes];
};
struct alignas(64) IntRow {
  int32_t at[kLanes];
};

// How far the mean of extinction, and of colour times extinction, may be from the table's: this part of the
// extinction there is, or this optical depth.
constexpr float kRelativeError = 1.0f / 256;
constexpr float kDepthError = 2e-5f;

constexpr float kPeak = 0.69995f;  // F(0), and a little

/// Intervals of the table: where they begin and end, and the weights of what lies there.
struct Intervals {
  IntRow from, to;
  Row first, last, scale;
};

struct Range {
  V from, to;
};

HWY_INLINE V cellsOf(const ShadingTable& table, V scalar) {
  const Floats d;
  if (table.logScale())
    scalar = hn::Log(d, hn::Max(scalar, hn::Set(d, ClassificationTable::kLeastLogarithmic)));
  return hn::MulAdd(scalar, hn::Set(d, table.scale()), hn::Set(d, table.bias()));
}

HWY_INLINE hn::Vec<Ints> element(V x) {
  const Floats d;
  constexpr float kLast = ClassificationTable::kCells + 1;
  return hn::ConvertTo(Ints(), hn::Clamp(hn::Add(x, hn::Set(d, 1.0f)), hn::Zero(d), hn::Set(d, kLast)));
}

/// What pixels with these means see, in cells: never less than a cell.
HWY_INLINE Range locate(const ShadingTable& table, V mean, V half_width, size_t lane, Intervals& out) {
  const Floats d;
  V from = cellsOf(table, hn::Sub(mean, half_width)), to = cellsOf(table, hn::Add(mean, half_width));
  const V half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
  const V widen = hn::Max(hn::Zero(d), hn::Mul(half, hn::Sub(one, hn::Sub(to, from))));
  from = hn::Sub(from, widen);
  to = hn::Add(to, widen);
  const V scale = hn::Div(one, hn::Sub(to, from));
  const auto i = element(from), j = element(to);
  hn::Store(i, Ints(), out.from.at + lane);
  hn::Store(j, Ints(), out.to.at + lane);
  hn::Store(hn::Mul(hn::Sub(hn::ConvertTo(d, i), from), scale), d, out.first.at + lane);
  hn::Store(hn::Mul(hn::Sub(to, hn::Sub(hn::ConvertTo(d, j), one)), scale), d, out.last.at + lane);
  hn::Store(scale, d, out.scale.at + lane);
  return {from, to};
}

/// The mean over an interval.
HWY_INLINE void meanOver(const ShadingTable& table, const Intervals& in, size_t n, float* HWY_RESTRICT out) {
  const Four d;
  const ShadingTable::Cell* cells = table.cells();
  const ShadingTable::Cell &from = cells[in.from.at[n]], &after = cells[in.from.at[n] + 1],
                           &to = cells[in.to.at[n]];
  for (size_t c = 0; c < 4; c += hn::Lanes(d)) {
    auto sum = hn::Mul(hn::Load(d, from.density.of + c), hn::Set(d, in.first.at[n]));
    sum = hn::MulAdd(hn::Load(d, to.density.of + c), hn::Set(d, in.last.at[n]), sum);
    sum = hn::MulAdd(hn::Sub(hn::Load(d, to.start.of + c), hn::Load(d, after.start.of + c)),
                     hn::Set(d, in.scale.at[n]), sum);
    hn::Store(hn::Max(sum, hn::Zero(d)), d, out + c);
  }
}

/// Sixteen pieces of splats: where the scalar goes in each.
struct Pieces {
  Row mean, reach, half_width;  // scalar = mean ± half_width at t = 0, and reach more by t
  Row from, to;                 // t
};

/// The look-ups for sixteen parabolas, and how far they are off at the most.
struct Fits {
  Intervals low, middle, high;
  Row error;
  Row log_error;  // of the change between ends; zero unless the scale is logarithmic
};

HWY_INLINE void fitPieces(const ShadingTable& table, const Pieces& pieces, Fits& fits) {
  const Floats d;
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const V mean = hn::Load(d, pieces.mean.at + lane), reach = hn::Load(d, pieces.reach.at + lane);
    const V half_width = hn::Load(d, pieces.half_width.at + lane);
    const V t0 = hn::Load(d, pieces.from.at + lane), t1 = hn::Load(d, pieces.to.at + lane);
    const V tm = hn::Mul(hn::Set(d, 0.5f), hn::Add(t0, t1));
    const Range low = locate(table, hn::MulAdd(reach, t0, mean), half_width, lane, fits.low);
    locate(table, hn::MulAdd(reach, tm, mean), half_width, lane, fits.middle);
    const Range high = locate(table, hn::MulAdd(reach, t1, mean), half_width, lane, fits.high);

    const V move = hn::Max(hn::Sub(high.to, low.to), hn::Sub(high.from, low.from));
    const V spread = hn::Mul(move, hn::Load(d, fits.low.scale.at + lane));
    const V factor = hn::Mul(move, hn::Min(spread, hn::Set(d, 1.0f)));
    const auto first = hn::ShiftLeft<1>(element(hn::Sub(low.from, hn::Set(d, 1.0f))));
    const auto last =
        hn::ShiftLeft<1>(hn::Add(element(hn::Add(high.to, hn::Set(d, 1.0f))), hn::Set(Ints(), 1)));
    const float* bends = &table.bends()->second;
    const V second = hn::Sub(hn::GatherIndex(d, bends, last), hn::GatherIndex(d, bends, first));
    const V third = hn::Sub(hn::GatherIndex(d, bends + 1, last), hn::GatherIndex(d, bends + 1, first));
    hn::Store(hn::Mul(factor, hn::Min(hn::Mul(hn::Set(d, 0.097f), second),
                                      hn::Mul(hn::Mul(hn::Set(d, 0.0189f), move), third))),
              d, fits.error.at + lane);
    // The third derivative of g(log m) has g'' and g' in it, too; r is the move in the logarithm:
    // 0.0189 (3 g'' r + 2 g' r²) at the most, with g'' and g' at most 4 changes.
    const V r = hn::Mul(move, hn::Set(d, table.logScale() ? 1 / table.scale() : 0.0f));
    hn::Store(hn::Mul(r, hn::MulAdd(r, hn::Set(d, 0.16f), hn::Set(d, 0.23f))), d, fits.log_error.at + lane);
  }
}

/// Colour times extinction, and extinction: at + s (by + s bend), with s = s0 + sp p + sq q.
struct Shade {
  alignas(16) float at[4], by[4], bend[4];
  float s0, sp, sq;
  float most;    // extinction
  float excess;  // where nothing fits: the error, in what is allowed
};

enum class Fit { nothing, constant, parabola, none };

/// Piece `n`'s, if that is good enough.
HWY_INLINE Fit shadeOf(const ShadingTable& table, const Pieces& pieces, const Fits& fits, size_t n,
                       float amplitude, Shade& shade) {
  const Four d;
  alignas(16) float low[4], middle[4], high[4], changes[4];
  meanOver(table, fits.low, n, low);
  meanOver(table, fits.middle, n, middle);
  meanOver(table, fits.high, n, high);
  const auto half = hn::Set(d, 0.5f);
  for (size_t c = 0; c < 4; c += hn::Lanes(d)) {
    const auto a = hn::Load(d, low + c), m = hn::Load(d, middle + c), b = hn::Load(d, high + c);
    hn::Store(m, d, shade.at + c);
    hn::Store(hn::Mul(half, hn::Sub(b, a)), d, shade.by + c);
    hn::Store(hn::Sub(hn::Mul(half, hn::Add(a, b)), m), d, shade.bend + c);
    hn::Store(hn::Max(hn::AbsDiff(a, m), hn::AbsDiff(b, m)), d, changes + c);
  }
  const float most = std::max({low[3], middle[3], high[3]});
  const float change = std::max({changes[0], changes[1], changes[2], changes[3]});
  const float error = fits.error.at[n] + change * fits.log_error.at[n];
  const float allowed = std::max(kRelativeError * most, kDepthError / (kPeak * amplitude));
  if (!(error <= allowed)) {
    shade.excess = error / allowed;
    return Fit::none;
  }
  if (most == 0) return Fit::nothing;
  shade.most = 1.25f * most;  // a parabola's between its three points
  if (error + change <= allowed) return Fit::constant;
  const float per_t = 2 / (pieces.to.at[n] - pieces.from.at[n]);
  shade.s0 = -0.5f * (pieces.from.at[n] + pieces.to.at[n]) * per_t;
  shade.sp = shade.sq = per_t;
  return Fit::parabola;
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#endif
