// Applies the transfer function to a splat's pixels, over a piece of the splat: a colour, a parabola or lines
// along the scalar's slope, or every pixel for itself. Included once for every instruction set.
#if defined(CURVISPLAT_PAINT_SHADE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CURVISPLAT_PAINT_SHADE_INL_H
#undef CURVISPLAT_PAINT_SHADE_INL_H
#else
#define CURVISPLAT_PAINT_SHADE_INL_H
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>
#include <bit>

#include "render/cpu/tile.h"
#include "render/project/light.h"

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

constexpr float kPeak = 0.69995f;  // F(0), and a little

/// Intervals of the table, and the weights of what lies there.
struct Intervals {
  IntRow from, to;  // floats from the table's first to the cell
  Row first, last;  // how much of the cells at the ends lies in the interval
  Row scale;        // over the interval's width
};

/// Colour times extinction, and extinction.
struct Values {
  Row of[4];
};

struct Range {
  V from, to;
};

HWY_INLINE V cellsOf(const ShadingTable& table, V scalar) {
  const Floats d;
  if (table.logScale())
    scalar = hn::Log(d, hn::Max(scalar, hn::Set(d, ClassificationTable::kMinLogarithmic)));
  return hn::MulAdd(scalar, hn::Set(d, table.scale()), hn::Set(d, table.bias()));
}

/// The element of the table that a place in cells is in, as a float.
HWY_INLINE V elementAt(V x) {
  const Floats d;
  constexpr float kLast = ClassificationTable::kCells + 1;
  return hn::Floor(hn::Clamp(hn::Add(x, hn::Set(d, 1.0f)), hn::Zero(d), hn::Set(d, kLast)));
}

/// The integer that a float is, from 0 to 2^23 - 1, by its bits: a conversion takes care of all that it may be.
HWY_INLINE hn::Vec<Ints> integerOf(V x) {
  const Floats d;
  const V shift = hn::Set(d, 0x1p23f);
  return hn::Sub(hn::BitCast(Ints(), hn::Add(x, shift)), hn::BitCast(Ints(), shift));
}

HWY_INLINE hn::Vec<Ints> element(V x) {
  return integerOf(elementAt(x));
}

/// The intervals that pixels with these means see, in cells: never less than a cell. An interval beyond an
/// end of the table sees the same wherever it lies there; it begins where float still tells cells apart.
HWY_INLINE Range locate(const ShadingTable& table, V mean, V half_width, size_t lane, Intervals& out) {
  static_assert(sizeof(ShadingTable::Cell) == 8 * sizeof(float));
  const Floats d;
  V from = cellsOf(table, hn::Sub(mean, half_width)), to = cellsOf(table, hn::Add(mean, half_width));
  from = hn::Min(from, hn::Set(d, ClassificationTable::kCells + 1.0f));
  to = hn::Max(to, hn::Set(d, -1.0f));
  const V half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
  const V widen = hn::Max(hn::Zero(d), hn::Mul(half, hn::Sub(one, hn::Sub(to, from))));
  from = hn::Sub(from, widen);
  to = hn::Add(to, widen);
  const V i = elementAt(from), j = elementAt(to);
  hn::Store(hn::ShiftLeft<3>(integerOf(i)), Ints(), out.from.at + lane);
  hn::Store(hn::ShiftLeft<3>(integerOf(j)), Ints(), out.to.at + lane);
  hn::Store(hn::Sub(i, from), d, out.first.at + lane);
  hn::Store(hn::Sub(to, hn::Sub(j, one)), d, out.last.at + lane);
  hn::Store(hn::Div(one, hn::Sub(to, from)), d, out.scale.at + lane);
  return {from, to};
}

/// The integral over interval n.
HWY_INLINE void integrateOne(const ShadingTable& table, const Intervals& in, size_t n,
                             float* HWY_RESTRICT out) {
  const Four d;
  constexpr size_t kDensity = 4, kNext = 8;  // from a cell's start
  const float* cells = table.cells()->start.of;
  const float *from = cells + in.from.at[n], *to = cells + in.to.at[n];
  for (size_t c = 0; c < 4; c += hn::Lanes(d)) {
    auto sum = hn::Sub(hn::Load(d, to + c), hn::Load(d, from + kNext + c));
    sum = hn::MulAdd(hn::Load(d, from + kDensity + c), hn::Set(d, in.first.at[n]), sum);
    sum = hn::MulAdd(hn::Load(d, to + kDensity + c), hn::Set(d, in.last.at[n]), sum);
    hn::Store(sum, d, out + 4 * n + c);
  }
}

/// The integrals over the first `count` intervals, one after the other, of 4 * kLanes; the others are zero.
HWY_INLINE void integrate(const ShadingTable& table, const Intervals& in, size_t count,
                          float* HWY_RESTRICT out) {
  for (size_t n = 0; n < count; ++n) integrateOne(table, in, n, out);
  std::fill(out + 4 * count, out + 4 * kLanes, 0.0f);
}

/// The integrals of no interval.
HWY_INLINE void clear(float (&out)[4 * kLanes]) {
  const Floats d;
  for (size_t n = 0; n < 4 * kLanes; n += hn::Lanes(d)) hn::Store(hn::Zero(d), d, out + n);
}

/// Integrates the intervals with a bit in `wanted` alone; the others stay what they are.
HWY_INLINE void integrateEach(const ShadingTable& table, const Intervals& in, uint32_t wanted,
                              float* HWY_RESTRICT out) {
  for (; wanted != 0; wanted &= wanted - 1)
    integrateOne(table, in, static_cast<size_t>(std::countr_zero(wanted)), out);
}

/// Bit n: lane n.
HWY_INLINE uint32_t bitsOf(hn::Mask<Floats> mask) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(Floats(), mask, bytes);
  return bytes[0] | uint32_t{bytes[1]} << 8;
}

/// Whether any of the lanes of the vector that begins at `lane` has its bit.
HWY_INLINE bool anyOf(uint32_t bits, size_t lane) {
  return (bits >> lane & ((1u << hn::Lanes(Floats())) - 1)) != 0;
}

/// Makes means of integrals.
HWY_INLINE void meansOf(const float* HWY_RESTRICT integrals, V scale, size_t lane, V (&out)[4]) {
  const Floats d;
  hn::LoadInterleaved4(d, integrals + 4 * lane, out[0], out[1], out[2], out[3]);
  for (V& value : out) value = hn::Max(hn::Mul(value, scale), hn::Zero(d));
}

/// Sixteen pieces of splats: where the scalar goes in each.
struct Pieces {
  Row mean, reach, half_width;  // scalar = mean ± half_width at t = 0, and reach more by t
  Row from, to;                 // t
  Row width_loss;               // of half_width at the most, where it is not the same everywhere
  Row amplitude;
};

enum Fit : int32_t { kNothing, kConstant, kParabola, kOther };

/// The fit of a piece: at + s (by + s bend), with s = -1 to 1 from end to end.
struct Fits {
  Values at, by, bend;
  Row excess;  // of a parabola's error over what is allowed, of kOther
  IntRow fit;

  /// Colours become what is seen of them in this light.
  HWY_INLINE void light(const Row& diffuse, const Row& specular) {
    const Floats d;
    for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
      const V colour = hn::Load(d, diffuse.at + lane), white = hn::Load(d, specular.at + lane);
      for (Values* values : {&at, &by, &bend}) {
        const V of_white = hn::Mul(hn::Load(d, values->of[3].at + lane), white);
        for (int c = 0; c < 3; ++c) {
          float* const value = values->of[c].at + lane;
          hn::Store(hn::MulAdd(hn::Load(d, value), colour, of_white), d, value);
        }
      }
    }
  }
};

/// How far the parabola through both ends and the middle is off, at the most (ShadingTable). An interval
/// that is narrower by 2 x `width_loss` cells sees something else by a quarter of that times the sum of
/// |second differences|, at the most: so much if they are all in its middle.
HWY_INLINE V errorOver(const ShadingTable& table, const Range& low, const Range& high, V low_scale,
                       V width_loss) {
  const Floats d;
  const V move = hn::Max(hn::Sub(high.to, low.to), hn::Sub(high.from, low.from));
  const V factor = hn::Mul(move, hn::Min(hn::Mul(move, low_scale), hn::Set(d, 1.0f)));
  const auto first = hn::ShiftLeft<1>(element(hn::Sub(low.from, hn::Set(d, 1.0f))));
  const auto last =
      hn::ShiftLeft<1>(hn::Add(element(hn::Add(high.to, hn::Set(d, 1.0f))), hn::Set(Ints(), 1)));
  const float* bends = &table.bends()->second;
  const V second = hn::Sub(hn::GatherIndex(d, bends, last), hn::GatherIndex(d, bends, first));
  const V third = hn::Sub(hn::GatherIndex(d, bends + 1, last), hn::GatherIndex(d, bends + 1, first));
  const V off = hn::Mul(factor, hn::Min(hn::Mul(hn::Set(d, 0.097f), second),
                                        hn::Mul(hn::Mul(hn::Set(d, 0.0189f), move), third)));
  return hn::MulAdd(hn::Mul(hn::Set(d, 0.25f), width_loss), second, off);
}

/// The largest error from the change between the ends, on a logarithmic scale. The third derivative of g(log
/// m) has g'' and g' in it, too; r is the move in the logarithm: 0.0189 (3 g'' r + 2 g' r²) at the most, with
/// g'' and g' at most 4 changes.
HWY_INLINE V logErrorOver(const ShadingTable& table, const Range& low, const Range& high) {
  const Floats d;
  const V move = hn::Max(hn::Sub(high.to, low.to), hn::Sub(high.from, low.from));
  const V r = hn::Mul(move, hn::Set(d, table.logScale() ? 1 / table.scale() : 0.0f));
  return hn::Mul(r, hn::MulAdd(r, hn::Set(d, 0.16f), hn::Set(d, 0.23f)));
}

/// The first `count` pieces.
HWY_INLINE void fitPieces(const ShadingTable& table, const Pieces& pieces, size_t count, Fits& fits) {
  const Floats d;
  Intervals low, middle, high;
  Row error, log_error;
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const V mean = hn::Load(d, pieces.mean.at + lane), reach = hn::Load(d, pieces.reach.at + lane);
    const V half_width = hn::Load(d, pieces.half_width.at + lane);
    const V t0 = hn::Load(d, pieces.from.at + lane), t1 = hn::Load(d, pieces.to.at + lane);
    const V tm = hn::Mul(hn::Set(d, 0.5f), hn::Add(t0, t1));
    const Range first = locate(table, hn::MulAdd(reach, t0, mean), half_width, lane, low);
    locate(table, hn::MulAdd(reach, tm, mean), half_width, lane, middle);
    const Range last = locate(table, hn::MulAdd(reach, t1, mean), half_width, lane, high);
    const V width_loss =
        hn::Mul(hn::Load(d, pieces.width_loss.at + lane), hn::Set(d, std::abs(table.scale())));
    hn::Store(errorOver(table, first, last, hn::Load(d, low.scale.at + lane), width_loss), d,
              error.at + lane);
    hn::Store(logErrorOver(table, first, last), d, log_error.at + lane);
  }
  alignas(64) float integrals[3][4 * kLanes];
  integrate(table, low, count, integrals[0]);
  integrate(table, middle, count, integrals[1]);
  integrate(table, high, count, integrals[2]);
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    V a[4], m[4], b[4];
    meansOf(integrals[0], hn::Load(d, low.scale.at + lane), lane, a);
    meansOf(integrals[1], hn::Load(d, middle.scale.at + lane), lane, m);
    meansOf(integrals[2], hn::Load(d, high.scale.at + lane), lane, b);
    const V half = hn::Set(d, 0.5f);
    V change = hn::Zero(d);
    for (size_t c = 0; c < 4; ++c) {
      hn::Store(m[c], d, fits.at.of[c].at + lane);
      hn::Store(hn::Mul(half, hn::Sub(b[c], a[c])), d, fits.by.of[c].at + lane);
      hn::Store(hn::Sub(hn::Mul(half, hn::Add(a[c], b[c])), m[c]), d, fits.bend.of[c].at + lane);
      change = hn::Max(change, hn::Max(hn::AbsDiff(a[c], m[c]), hn::AbsDiff(b[c], m[c])));
    }
    const V most = hn::Max(hn::Max(a[3], m[3]), b[3]);
    const V off = hn::MulAdd(change, hn::Load(d, log_error.at + lane), hn::Load(d, error.at + lane));
    const V depth = hn::Mul(hn::Set(d, kPeak), hn::Load(d, pieces.amplitude.at + lane));
    const V allowed =
        hn::Max(hn::Mul(hn::Set(d, kRelativeError), most), hn::Div(hn::Set(d, kDepthError), depth));
    const auto code = [&](Fit fit) HWY_ATTR { return hn::Set(d, static_cast<float>(fit)); };
    V fit = hn::IfThenElse(hn::Le(hn::Add(off, change), allowed), code(kConstant), code(kParabola));
    fit = hn::IfThenElse(hn::Eq(most, hn::Zero(d)), code(kNothing), fit);
    fit = hn::IfThenElse(hn::Le(off, allowed), fit, code(kOther));
    hn::Store(hn::ConvertTo(Ints(), fit), Ints(), fits.fit.at + lane);
    hn::Store(hn::Div(off, allowed), d, fits.excess.at + lane);
  }
}

/// Row, and its last element again: to be read from its second.
struct alignas(64) LongRow {
  float at[2 * kLanes];

  HWY_INLINE void repeatLast() { at[kLanes] = at[kLanes - 1]; }
};

/// Interval of the scalar that moves from end to end of a piece.
struct Moving {
  float mean, reach, half_width;
  float from, to;  // t
};

/// The means of the function at sixteen places of a piece.
struct Knots {
  LongRow of[4];
  float error;  // of the lines from knot to knot, at the most
  float most;   // extinction

  /// Computes them. A line over a move by h cells is off by at most h min(h / 2w / 8, 1/4) times the sum of |second differences|
  /// (ShadingTable); and on a logarithmic scale, where the move itself is bent, by an eighth of r (of twice that, since
  /// r <= 0.3 changes within the move) times the largest slope.
  HWY_INLINE void set(const ShadingTable& table, const Moving& moving) {
    const Floats d;
    const float per_part = (moving.to - moving.from) / (kLanes - 1);
    Intervals intervals;
    LongRow begins, ends;
    for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
      const V t =
          hn::MulAdd(hn::Iota(d, static_cast<float>(lane)), hn::Set(d, per_part), hn::Set(d, moving.from));
      const V mean = hn::MulAdd(hn::Set(d, moving.reach), t, hn::Set(d, moving.mean));
      const Range range = locate(table, mean, hn::Set(d, moving.half_width), lane, intervals);
      hn::Store(range.from, d, begins.at + lane);
      hn::Store(range.to, d, ends.at + lane);
    }
    begins.repeatLast();
    ends.repeatLast();
    alignas(64) float integrals[4 * kLanes];
    integrate(table, intervals, kLanes, integrals);
    V largest = hn::Zero(d);
    for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
      V value[4];
      meansOf(integrals, hn::Load(d, intervals.scale.at + lane), lane, value);
      for (size_t c = 0; c < 4; ++c) hn::Store(value[c], d, of[c].at + lane);
      largest = hn::Max(largest, value[3]);
    }
    for (LongRow& row : of) row.repeatLast();
    most = hn::GetLane(hn::MaxOfLanes(d, largest));
    const bool is_log = table.logScale();
    const V log_unit = hn::Set(d, is_log ? 1 / table.scale() : 0.0f);
    const float* bends = &table.bends()->second;
    V off_most = hn::Zero(d);
    for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
      const V begin = hn::Load(d, begins.at + lane), end = hn::LoadU(d, ends.at + lane + 1);
      const V begin_after = hn::LoadU(d, begins.at + lane + 1), end_before = hn::Load(d, ends.at + lane);
      const V move = hn::Max(hn::Abs(hn::Sub(begin_after, begin)), hn::Abs(hn::Sub(end, end_before)));
      const V low = hn::Min(begin, begin_after), high = hn::Max(end, end_before);
      const auto first = hn::ShiftLeft<1>(element(hn::Sub(low, hn::Set(d, 1.0f))));
      const auto last =
          hn::ShiftLeft<1>(hn::Add(element(hn::Add(high, hn::Set(d, 1.0f))), hn::Set(Ints(), 1)));
      const V second = hn::Sub(hn::GatherIndex(d, bends, last), hn::GatherIndex(d, bends, first));
      const V over_width = hn::Mul(hn::Set(d, 0.125f), hn::Mul(move, hn::Load(d, intervals.scale.at + lane)));
      V off = hn::Mul(hn::Mul(move, hn::Min(over_width, hn::Set(d, 0.25f))), second);
      if (is_log) {
        V change = hn::Zero(d);
        for (const LongRow& row : of)
          change = hn::Max(change, hn::AbsDiff(hn::LoadU(d, row.at + lane + 1), hn::Load(d, row.at + lane)));
        const V r = hn::Mul(move, hn::Abs(log_unit));
        off = hn::MulAdd(hn::Mul(hn::Set(d, 0.25f), r), hn::Add(change, hn::Mul(move, second)), off);
        off = hn::IfThenElse(hn::Gt(r, hn::Set(d, 0.3f)), hn::Set(d, 1e30f), off);
      }
      off_most = hn::Max(off_most, off);
    }
    error = hn::GetLane(hn::MaxOfLanes(d, off_most));
  }

  HWY_INLINE bool areWithin(float amplitude) const {
    return error <= std::max(kRelativeError * most, kDepthError / (kPeak * amplitude));
  }
};

/// Lines from knot to knot, where a parabola does not do for a piece: s = 0 to kParts from end to end.
struct Lines {
  static constexpr float kParts = kLanes - 1;

  Values knots;

  /// Does what Fits::light() does.
  HWY_INLINE void light(const Lit& lit) {
    const Floats d;
    for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
      const V white = hn::Mul(hn::Load(d, knots.of[3].at + lane), hn::Set(d, lit.specular));
      for (int c = 0; c < 3; ++c) {
        float* const value = knots.of[c].at + lane;
        hn::Store(hn::MulAdd(hn::Load(d, value), hn::Set(d, lit.diffuse), white), d, value);
      }
    }
  }

  HWY_INLINE void valuesAt(V s, V (&value)[4]) const {
    const Floats d;
    // The last part ends at a float below kParts, so that each has a knot behind it.
    s = hn::Clamp(s, hn::Zero(d), hn::Set(d, kParts - 1e-6f * kParts));
    const V whole = hn::Floor(s), part = hn::Sub(s, whole);
    const auto n = integerOf(whole), next = hn::Add(n, hn::Set(Ints(), 1));
    for (int c = 0; c < 4; ++c) {
      const V from = lookUp(knots.of[c], n);
      value[c] = hn::MulAdd(part, hn::Sub(lookUp(knots.of[c], next), from), from);
    }
  }

 private:
  HWY_INLINE static V lookUp(const Row& row, hn::Vec<Ints> n) {
    const Floats d;
    if constexpr (hn::MaxLanes(d) == kLanes) {
      return hn::TableLookupLanes(hn::Load(d, row.at), hn::IndicesFromVec(d, n));
    } else if constexpr (2 * hn::MaxLanes(d) == kLanes) {
      const auto half = hn::Set(Ints(), kLanes / 2);
      const auto in_half = hn::IndicesFromVec(d, hn::And(n, hn::Set(Ints(), kLanes / 2 - 1)));
      return hn::IfThenElse(hn::RebindMask(d, hn::Lt(n, half)),
                            hn::TableLookupLanes(hn::Load(d, row.at), in_half),
                            hn::TableLookupLanes(hn::Load(d, row.at + kLanes / 2), in_half));
    } else {
      return hn::GatherIndex(d, row.at, n);
    }
  }
};

/// Flat splats: `at` and `fit`, of their means alone.
HWY_INLINE void fitMeans(const ShadingTable& table, const Pieces& pieces, size_t count, Fits& fits) {
  const Floats d;
  Intervals intervals;
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d))
    locate(table, hn::Load(d, pieces.mean.at + lane), hn::Zero(d), lane, intervals);
  alignas(64) float integrals[4 * kLanes];
  integrate(table, intervals, count, integrals);
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    V value[4];
    meansOf(integrals, hn::Load(d, intervals.scale.at + lane), lane, value);
    for (size_t c = 0; c < 4; ++c) hn::Store(value[c], d, fits.at.of[c].at + lane);
    const V fit = hn::IfThenElse(hn::Gt(value[3], hn::Zero(d)), hn::Set(d, static_cast<float>(kConstant)),
                                 hn::Set(d, static_cast<float>(kNothing)));
    hn::Store(hn::ConvertTo(Ints(), fit), Ints(), fits.fit.at + lane);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#endif
