// Sixteen splats of a tile at a time, from their records to what is painted: their ellipses, the blocks that they
// touch, and how their scalar goes there. Included once for every instruction set.
#if defined(CURVISPLAT_PAINT_VISITS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CURVISPLAT_PAINT_VISITS_INL_H
#undef CURVISPLAT_PAINT_VISITS_INL_H
#else
#define CURVISPLAT_PAINT_VISITS_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "render/cpu/paint_blocks-inl.h"
#include "render/cpu/paint_shade-inl.h"
#include "render/cpu/tile.h"
#include "render/project/footprint.h"

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr auto kSupport = static_cast<float>(kKernelSupport);
constexpr float kSqrt3 = 1.7320508f;
constexpr float kReachOfHalfWidth = ScreenCut::kReach / kSqrt3;
constexpr auto kHalfWidthMask = static_cast<int32_t>(0xffff0000u);  // as light.h packs it

/// Sixteen splats of a tile, ready to be painted.
struct Visits {
  Row x, y, a, b, c;            // Ellipse
  Row tp, tq;                   // Scalar's
  Row cut;                      // 1 where the splat is cut; its pieces' reach is then that of the cut, too
  Row along;                    // ScreenSplat's, of splats that hide some of themselves; else 0
  Row nearer, seen_half_width;  // Scalar's
  Row cell_depth;               // geometric, of their cells
  Row diffuse, specular;        // Lit, in lit pictures
  Row pixels;                   // of the tile, in the ellipse's own rectangle
  Pieces pieces;                // all of the splat that is in the tile
  IntRow skew;                  // ScreenSplat's

  HWY_INLINE Ellipse ellipse(size_t n) const {
    const auto packed = static_cast<uint32_t>(skew.at[n]);
    return {x.at[n],     y.at[n],
            a.at[n],     b.at[n],
            c.at[n],     pieces.amplitude.at[n],
            packed != 0, SkewPolynomial(packed)};
  }
  HWY_INLINE Lit lit(const TileWork& work, size_t n) const {
    return work.shading.lit ? Lit{diffuse.at[n], specular.at[n]} : Lit{};
  }
  HWY_INLINE Scalar scalar(size_t n) const {
    return {pieces.mean.at[n], pieces.reach.at[n],   tp.at[n], tq.at[n], pieces.half_width.at[n],
            nearer.at[n],      seen_half_width.at[n]};
  }
};

HWY_INLINE V gather(const TileWork& work, hn::Vec<Ints> offsets, size_t member) {
  return hn::GatherIndex(Floats(), reinterpret_cast<const float*>(work.splats.data()) + member, offsets);
}

/// The t of the pixels in a box.
HWY_INLINE Range tOver(V by_x, V by_y, V middle_x, V middle_y, V half_x, V half_y) {
  const Floats d;
  const V middle = hn::MulAdd(by_x, middle_x, hn::Mul(by_y, middle_y));
  const V half = hn::MulAdd(hn::Abs(by_x), half_x, hn::Mul(hn::Abs(by_y), half_y));
  const V one = hn::Set(d, 1.0f);
  return {hn::Clamp(hn::Sub(middle, half), hn::Neg(one), one),
          hn::Clamp(hn::Add(middle, half), hn::Neg(one), one)};
}

/// How many cells of the table a unit of the scalar is, around this one.
HWY_INLINE V cellsAScalar(const ShadingTable& table, V scalar) {
  const Floats d;
  const V scale = hn::Set(d, std::abs(table.scale()));
  if (!table.logScale()) return scale;
  return hn::Div(scale, hn::Max(hn::Abs(scalar), hn::Set(d, ClassificationTable::kMinLogarithmic)));
}

/// The depth of splats' cells along the ray: the footprints of neighbours add up to one, so it is the
/// amplitude without the low-pass.
HWY_INLINE V cellDepth(const TileWork& work, V amplitude, V l11, V l21, V l22) {
  const Floats d;
  const V low_pass = hn::Set(d, work.shading.low_pass_px2);
  const V s00 = hn::MulSub(l11, l11, low_pass);
  const V s11 = hn::Sub(hn::MulAdd(l21, l21, hn::Mul(l22, l22)), low_pass);
  const V s01 = hn::Mul(l11, l21), passed = hn::Mul(l11, l22);
  const V determinant = hn::NegMulAdd(s01, s01, hn::Mul(s00, s11));
  const V least = hn::Mul(hn::Set(d, 1e-4f), hn::Mul(passed, passed));
  return hn::Mul(amplitude, hn::Div(passed, hn::Sqrt(hn::Max(determinant, least))));
}

/// The most by which the scalar that is seen of splats may differ from their mean, since their nearer sides
/// hide the others.
HWY_INLINE V hidesItself(const TileWork& work, V cell_depth, V along) {
  const Floats d;
  const V tau = hn::Mul(cell_depth, hn::Set(d, work.table.mostExtinction()));
  return hn::Mul(hn::Mul(hn::Set(d, kSqrt3), hn::Abs(along)),
                 hn::Min(hn::Mul(tau, hn::Set(d, 1.0f / 6)), hn::Set(d, 1.0f)));
}

// The least pixels of a splat's rectangle in a tile for which lines are worth their fit; the largest error of a parabola,
// over what is allowed, for which they are tried.
constexpr float kMinLinesPixels = 96, kMaxLinesExcess = 60;

// The least hidesItself() that is worth the work, in cells of the table: a 250th of the function.
constexpr float kHidingCells = 16;

/// Sets up the visits from the splats with these numbers.
HWY_INLINE void setUp(const TileWork& work, const IntRow& numbers, Visits& out) {
  constexpr int32_t kFloats = sizeof(ScreenSplat) / sizeof(float);
  static_assert(kFloats == 16);
  const Floats d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f);
  const V support = hn::Set(d, kSupport), last_pixel = hn::Set(d, kTileSide - 1);
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const auto store = [&](V value, Row& row) HWY_ATTR { hn::Store(value, d, row.at + lane); };
    const auto offsets = hn::Mul(hn::Load(Ints(), numbers.at + lane), hn::Set(Ints(), kFloats));
    const V l11 = gather(work, offsets, 2), l21 = gather(work, offsets, 3), l22 = gather(work, offsets, 4);
    const V x = hn::Sub(gather(work, offsets, 0), hn::Set(d, static_cast<float>(work.x) + 0.5f));
    const V y = hn::Sub(gather(work, offsets, 1), hn::Set(d, static_cast<float>(work.y) + 0.5f));
    const V a = hn::Div(one, hn::Mul(support, l11)), c = hn::Div(one, hn::Mul(support, l22));
    const V b = hn::Neg(hn::Mul(hn::Mul(l21, support), hn::Mul(a, c)));
    store(x, out.x);
    store(y, out.y);
    store(a, out.a);
    store(b, out.b);
    store(c, out.c);
    hn::Store(hn::BitCast(Ints(), gather(work, offsets, 10)), Ints(), out.skew.at + lane);
    const V amplitude = gather(work, offsets, 5);
    const auto cut = hn::Lt(amplitude, zero);
    store(hn::Abs(amplitude), out.pieces.amplitude);
    store(hn::IfThenElseZero(cut, one), out.cut);

    // The pixels of the tile that lie in the ellipse's own rectangle.
    const V reach_x = hn::Mul(support, l11);
    const V reach_y = hn::Mul(support, hn::Sqrt(hn::MulAdd(l21, l21, hn::Mul(l22, l22))));
    const V x0 = hn::Clamp(hn::Ceil(hn::Sub(x, reach_x)), zero, hn::Set(d, kTileSide));
    const V y0 = hn::Clamp(hn::Ceil(hn::Sub(y, reach_y)), zero, hn::Set(d, kTileSide));
    const V x1 = hn::Clamp(hn::Floor(hn::Add(x, reach_x)), hn::Neg(one), last_pixel);
    const V y1 = hn::Clamp(hn::Floor(hn::Add(y, reach_y)), hn::Neg(one), last_pixel);
    store(hn::Mul(hn::Add(hn::Sub(x1, x0), one), hn::Add(hn::Sub(y1, y0), one)), out.pixels);
    if (work.shading.lit) {
      const auto bits = hn::BitCast(Ints(), gather(work, offsets, 9));
      const auto share = [&](auto shifted, int32_t mask) HWY_ATTR {
        const V of_mask = hn::ConvertTo(d, hn::And(shifted, hn::Set(Ints(), mask)));
        return hn::Mul(of_mask, hn::Set(d, 1.0f / static_cast<float>(mask)));
      };
      store(share(hn::ShiftRight<7>(bits), 511), out.diffuse);
      store(share(bits, 127), out.specular);
    }
    store(gather(work, offsets, 6), out.pieces.mean);
    if (!work.shading.per_pixel) {
      for (Row* row : {&out.pieces.reach, &out.pieces.half_width, &out.pieces.from, &out.pieces.to, &out.tp,
                       &out.tq, &out.pieces.width_loss, &out.along, &out.nearer, &out.cell_depth})
        store(zero, *row);
      continue;
    }
    const V slope0 = gather(work, offsets, 7), slope1 = gather(work, offsets, 8);
    const V slope = hn::Sqrt(hn::MulAdd(slope0, slope0, hn::Mul(slope1, slope1)));
    const V inverse = hn::Div(one, hn::Max(slope, hn::Set(d, 1e-37f)));
    const V tp = hn::Mul(slope0, inverse), tq = hn::Mul(slope1, inverse);
    store(tp, out.tp);
    store(tq, out.tq);
    V half_width = gather(work, offsets, 9);
    if (work.shading.lit) half_width = hn::And(half_width, hn::BitCast(d, hn::Set(Ints(), kHalfWidthMask)));
    store(half_width, out.pieces.half_width);
    Range t = tOver(hn::MulAdd(tp, a, hn::Mul(tq, b)), hn::Mul(tq, c),
                    hn::Sub(hn::Mul(half, hn::Add(x0, x1)), x), hn::Sub(hn::Mul(half, hn::Add(y0, y1)), y),
                    hn::Mul(half, hn::Sub(x1, x0)), hn::Mul(half, hn::Sub(y1, y0)));
    V reach = hn::Mul(support, slope), width_loss = zero;
    const V along = gather(work, offsets, 11),
            cell_depth = cellDepth(work, hn::Abs(amplitude), l11, l21, l22);
    const V seen_nearer = hidesItself(work, cell_depth, along);
    store(cell_depth, out.cell_depth);
    const auto hides = hn::Gt(hn::Mul(seen_nearer, cellsAScalar(work.table, gather(work, offsets, 6))),
                              hn::Set(d, kHidingCells));
    store(hn::IfThenElseZero(hides, along), out.along);
    store(zero, out.nearer);
    if (!hn::AllFalse(d, cut)) {
      // ScreenCut's correlation: how far the mean moves by what is left along the ray, which is all over the
      // splat, and how much narrower the scalar's distribution becomes.
      const int32_t beside = (work.colours ? -2 : -1) * kFloats;
      const auto in_cut =
          hn::IfThenElse(hn::RebindMask(Ints(), cut), hn::Set(Ints(), 2 + beside), hn::Set(Ints(), 2));
      const V mark = hn::Neg(
          hn::GatherIndex(d, reinterpret_cast<const float*>(work.splats.data()), hn::Add(offsets, in_cut)));
      const V far_sides = hn::Floor(hn::Mul(mark, hn::Set(d, 0.25f)));
      const V correlation = hn::Sub(hn::NegMulAdd(far_sides, hn::Set(d, 4.0f), mark), hn::Set(d, 2.0f));
      const V moved = hn::Mul(hn::Mul(hn::Abs(correlation), half_width), hn::Set(d, kReachOfHalfWidth));
      const V kept = hn::Sqrt(hn::Max(hn::NegMulAdd(correlation, correlation, one), zero));
      reach = hn::IfThenElse(cut, hn::Add(reach, moved), reach);
      width_loss = hn::IfThenElseZero(cut, hn::Mul(half_width, hn::Sub(one, kept)));
      const auto moves = hn::And(cut, hn::Or(hn::Gt(moved, zero), hides));
      t = {hn::IfThenElse(moves, hn::Neg(one), t.from), hn::IfThenElse(moves, one, t.to)};
    }
    store(reach, out.pieces.reach);
    store(width_loss, out.pieces.width_loss);
    store(t.from, out.pieces.from);
    store(t.to, out.pieces.to);
  }
}

HWY_INLINE int takeFirst(BlockMask& blocks) {
  const int first = std::countr_zero(blocks);
  blocks &= blocks - 1;
  return first;
}

HWY_INLINE Corner cornerOf(int block) {
  return {static_cast<float>(block % kTileBlocks * kBlockSide),
          static_cast<float>(block / kTileBlocks * kBlockSide)};
}

/// Paints blocks: paint(block), whether it is saturated then. Returns those that are.
template <typename Paint>
HWY_INLINE BlockMask paintBlocks(BlockMask blocks, const Paint& paint) {
  BlockMask saturated = 0;
  while (blocks != 0) {
    const int block = takeFirst(blocks);
    if (paint(block)) saturated |= BlockMask{1} << block;
  }
  return saturated;
}

/// Paints blocks of a tile: blend(block, its colours). Returns those that are saturated then.
template <typename Blend>
HWY_INLINE BlockMask blendBlocks(const TileWork& work, BlockMask blocks, const Blend& blend) {
  return paintBlocks(blocks, [&](int block) HWY_ATTR {
    return paintBlock(work.tile + block * kBlockFloats,
                      [&](BlockColours& colours) HWY_ATTR { blend(block, colours); });
  });
}

/// Paints blocks with a look-up for every pixel: look_up(block, where to), false for nothing. A few blocks
/// are looked up before they are blended: what was written as many narrow vectors is not ready at once to be
/// read as a wide one.
template <typename LookUp>
HWY_INLINE BlockMask paintLookedUpBlocks(const TileWork& work, BlockMask blocks, const Lit& lit,
                                         const LookUp& look_up) {
  constexpr int kAtOnce = 8;
  LookedUp looked_up[kAtOnce];
  int numbers[kAtOnce];
  BlockMask saturated = 0;
  while (blocks != 0) {
    int count = 0;
    while (blocks != 0 && count < kAtOnce) {
      const int block = numbers[count] = takeFirst(blocks);
      if (look_up(block, looked_up[count])) ++count;
    }
    for (int n = 0; n < count; ++n)
      if (paintLookedUp(looked_up[n], lit, work.tile + numbers[n] * kBlockFloats))
        saturated |= BlockMask{1} << numbers[n];
  }
  return saturated;
}

/// Replaces the colours in `fits`, for splats that hide some of themselves, by what is seen of them: those of
/// their nearer sides. The optical depths stay. By the extinction in their middles.
HWY_INLINE void fitNearSides(const ShadingTable& table, Visits& visits, size_t count, Fits& fits) {
  const Floats d;
  const V zero = hn::Zero(d);
  V any = zero;
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d))
    any = hn::Max(any, hn::Abs(hn::Load(d, visits.along.at + lane)));
  if (hn::AllTrue(d, hn::Eq(any, zero))) return;
  Pieces nearer = visits.pieces;
  any = zero;
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const V along = hn::Load(d, visits.along.at + lane),
            half_width = hn::Load(d, visits.pieces.half_width.at + lane);
    const V tau = hn::Mul(hn::Load(d, visits.cell_depth.at + lane), hn::Load(d, fits.at.of[3].at + lane));
    const V side = nearSide(tau), moved = hn::Mul(hn::Mul(hn::Set(d, kSqrt3), along), side);
    const V lost = hn::Mul(hn::Mul(hn::Set(d, 3.0f), hn::Mul(along, along)), lostByHiding(tau, side));
    const V narrower = hn::Sqrt(hn::Max(hn::MulSub(half_width, half_width, lost), zero));
    // By the largest extinction of all, more seemed to hide something.
    const V cells = hn::Mul(hn::Abs(moved), cellsAScalar(table, hn::Load(d, visits.pieces.mean.at + lane)));
    const auto worth = hn::Gt(cells, hn::Set(d, kHidingCells));
    any = hn::Max(any, hn::IfThenElseZero(worth, cells));
    hn::Store(hn::IfThenElseZero(worth, along), d, visits.along.at + lane);
    hn::Store(hn::IfThenElseZero(worth, moved), d, visits.nearer.at + lane);
    hn::Store(narrower, d, visits.seen_half_width.at + lane);
    hn::Store(hn::Sub(hn::Load(d, visits.pieces.mean.at + lane), moved), d, nearer.mean.at + lane);
    hn::Store(narrower, d, nearer.half_width.at + lane);
  }
  if (hn::AllTrue(d, hn::Eq(any, zero))) return;
  Fits seen{};
  fitPieces(table, nearer, count, seen);
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    const auto hides = hn::Ne(hn::Load(d, visits.along.at + lane), zero);
    // At both ends and in the middle.
    V value[3][4], of_near[3][4];
    for (int c = 0; c < 4; ++c) {
      const auto points = [&](const Fits& of, V(&out)[3][4]) HWY_ATTR {
        const V at = hn::Load(d, of.at.of[c].at + lane), by = hn::Load(d, of.by.of[c].at + lane);
        const V ends = hn::Add(at, hn::Load(d, of.bend.of[c].at + lane));
        out[0][c] = hn::Max(hn::Sub(ends, by), zero);
        out[1][c] = hn::Max(at, zero);
        out[2][c] = hn::Max(hn::Add(ends, by), zero);
      };
      points(fits, value);
      points(seen, of_near);
    }
    for (int point = 0; point < 3; ++point) showNearSide(of_near[point], value[point]);
    const V half = hn::Set(d, 0.5f);
    for (int c = 0; c < 3; ++c) {
      const auto replace = [&](Values& values, V by) HWY_ATTR {
        float* const place = values.of[c].at + lane;
        hn::Store(hn::IfThenElse(hides, by, hn::Load(d, place)), d, place);
      };
      replace(fits.at, value[1][c]);
      replace(fits.by, hn::Mul(half, hn::Sub(value[2][c], value[0][c])));
      replace(fits.bend, hn::Sub(hn::Mul(half, hn::Add(value[0][c], value[2][c])), value[1][c]));
    }
    float* const excess = fits.excess.at + lane;
    const V of_both = hn::Max(hn::Load(d, excess), hn::Load(d, seen.excess.at + lane));
    hn::Store(hn::IfThenElse(hides, of_both, hn::Load(d, excess)), d, excess);
    // The worse of both; nothing only where the whole has nothing.
    const auto fit = hn::Load(Ints(), fits.fit.at + lane), of_seen = hn::Load(Ints(), seen.fit.at + lane);
    const auto worse = hn::IfThenElseZero(hn::Gt(fit, hn::Set(Ints(), kNothing)), hn::Max(fit, of_seen));
    hn::Store(hn::IfThenElse(hn::RebindMask(Ints(), hides), worse, fit), Ints(), fits.fit.at + lane);
  }
}

/// Visit `n` of sixteen.
struct Visit {
  const Visits& all;
  const Fits& fits;
  size_t n;

  HWY_INLINE Ellipse ellipse() const { return all.ellipse(n); }
  HWY_INLINE Scalar scalar() const { return all.scalar(n); }
  HWY_INLINE int32_t fit() const { return fits.fit.at[n]; }
};

/// Whether lines may do for a splat where a parabola does not, and be worth their fit: as much work as some blocks looked
/// up. Which blocks are open does not count: another process may know of others.
HWY_INLINE bool mayHaveLines(const Visit& visit) {
  return visit.all.pixels.at[visit.n] >= kMinLinesPixels && visit.fits.excess.at[visit.n] < kMaxLinesExcess;
}

/// Fits lines to what is seen of a splat. Returns whether they are good enough.
HWY_INLINE bool fitLines(const TileWork& work, const Visit& visit, Lines& lines) {
  const auto& [visits, fits, n] = visit;
  const ShadingTable& table = work.table;
  const Floats d;
  const Pieces& pieces = visits.pieces;
  Moving moving{pieces.mean.at[n], pieces.reach.at[n], pieces.half_width.at[n], pieces.from.at[n],
                pieces.to.at[n]};
  Knots all, seen;
  all.set(table, moving);
  if (!all.areWithin(pieces.amplitude.at[n])) return false;
  const bool hides = visits.nearer.at[n] != 0;
  if (hides) {
    moving.mean -= visits.nearer.at[n];
    moving.half_width = visits.seen_half_width.at[n];
    seen.set(table, moving);
    if (!seen.areWithin(pieces.amplitude.at[n])) return false;
  }
  for (size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    V value[4], of_near[4];
    for (int c = 0; c < 4; ++c) value[c] = hn::Load(d, all.of[c].at + lane);
    if (hides) {
      for (int c = 0; c < 4; ++c) of_near[c] = hn::Load(d, seen.of[c].at + lane);
      showNearSide(of_near, value);
    }
    for (int c = 0; c < 4; ++c) hn::Store(value[c], d, lines.knots.of[c].at + lane);
  }
  if (work.shading.lit) lines.light(visits.lit(work, n));
  return true;
}

/// The change from `begin` to `end` over piece n.
HWY_INLINE Along along(const Pieces& pieces, size_t n, const Scalar& scalar, float begin, float end) {
  const float from = pieces.from.at[n];
  const float per_t = (end - begin) / (pieces.to.at[n] - from);
  return {begin - from * per_t, per_t * scalar.tp, per_t * scalar.tq};
}

HWY_INLINE Along alongLines(const Visit& visit) {
  return along(visit.all.pieces, visit.n, visit.scalar(), 0, Lines::kParts);
}

HWY_INLINE Shade shadeOf(const Fits& fits, size_t n) {
  Shade shade;
  for (int c = 0; c < 4; ++c) {
    shade.at[c] = fits.at.of[c].at[n];
    shade.by[c] = fits.by.of[c].at[n];
    shade.bend[c] = fits.bend.of[c].at[n];
  }
  shade.s = {};
  return shade;
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#endif
