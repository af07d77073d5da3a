#include <cmath>

#include "render/surface/rasterizer.h"

// The code from here to HWY_AFTER_NAMESPACE is compiled once for every instruction set that a processor may
// have.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/surface/draw_capsules.cpp"
#include <hwy/foreach_target.h>  // before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kAtOnce = 16;
constexpr float kOutermost = 0.7f;  // pixels: samples are no farther from their pixel's middle
using Floats = hn::CappedTag<float, kAtOnce>;
using Ints = hn::RebindToSigned<Floats>;
using Samples = hn::CappedTag<float, kSamples>;
using SampleNumbers = hn::RebindToUnsigned<Samples>;
using S = hn::Vec<Samples>;

/// Sixteen capsules, ready to be filled. Lengths are in pixels at the first end, a.
struct Setups {
  struct alignas(64) Row {
    float at[kAtOnce];
  };
  struct alignas(64) IntRow {
    int32_t at[kAtOnce];
  };
  Row ax, ay, a_value, bx, by, b_value;
  Row ratio;                       // of the depths, b's to a's
  Row ux, uy, uz, length, end_z;   // from a to b
  Row begin, end;                  // of the cylinder along the axis: infinite where the near plane cuts it
  Row radius_a, radius_b, growth;  // of the radius, along
  Row sine2, per_sine2;            // orthographic: of the angle between the axis and the view
  Row least;                       // of the values
  Row across_x, across_y, reach;   // the strip of the screen in which it lies: |(x, y) - a| across
  IntRow x0, y0, x1, y1;           // pixels, the last included
};

HWY_INLINE void gatherEnds(const CapsuleWork& work, size_t begin, Setups& out) {
  for (size_t n = 0; n < kAtOnce; ++n) {
    const auto& [a, b] = work.capsules[begin + n < work.capsules.size() ? begin + n : begin];
    out.ax.at[n] = a.x;
    out.ay.at[n] = a.y;
    out.a_value.at[n] = a.value;
    out.bx.at[n] = b.x;
    out.by.at[n] = b.y;
    out.b_value.at[n] = b.value;
  }
}

using F = hn::Vec<Floats>;

struct End {
  F x, y, value, radius;
};

/// The bounds of a ball: how far it reaches on the screen from its middle, and its least value.
struct Bounds {
  F reach, least;
};

/// Computes the bounds as reachOf() of capsule.cpp does.
template <bool kPerspective>
HWY_INLINE Bounds boundsOf(const CapsuleLook& look, const End& end) {
  const Floats d;
  const F focal = hn::Set(d, look.focal), one = hn::Set(d, 1.0f);
  const F part = hn::Div(end.radius, focal);
  if constexpr (!kPerspective) return {end.radius, hn::Sub(end.value, part)};
  const F part2 = hn::Mul(part, part);
  auto apart = hn::Lt(part, hn::Set(d, CapsuleLook::kNearPart));
  if (!look.in_pixels) apart = hn::AndNot(hn::Eq(end.value, hn::Set(d, look.nearest)), apart);
  const F across = hn::Div(hn::Sub(end.x, hn::Set(d, look.middle_x)), focal),
          down = hn::Div(hn::Sub(end.y, hn::Set(d, look.middle_y)), focal);
  const F out2 = hn::Add(hn::Mul(across, across), hn::Mul(down, down)), out = hn::Sqrt(out2);
  const F root = hn::Sqrt(hn::Max(hn::Sub(hn::Add(one, out2), part2), hn::Zero(d)));
  const F far = hn::Div(hn::Add(out, hn::Mul(part, root)), hn::Sub(one, part2));
  const F nearest = hn::Set(d, look.nearest);
  return {hn::IfThenElse(apart, hn::Mul(focal, hn::Sub(far, out)), hn::Set(d, CapsuleLook::kEverywhere)),
          hn::IfThenElse(apart, hn::Max(hn::Div(end.value, hn::Sub(one, part)), nearest), nearest)};
}

/// Lanes `n` and on.
template <bool kPerspective>
HWY_INLINE void setUp(const CapsuleLook& look, const SampleBox& box, size_t n, Setups& s) {
  const Floats d;
  const Ints di;
  using V = hn::Vec<Floats>;
  const V ax = hn::Load(d, s.ax.at + n), ay = hn::Load(d, s.ay.at + n), av = hn::Load(d, s.a_value.at + n);
  const V bx = hn::Load(d, s.bx.at + n), by = hn::Load(d, s.by.at + n), bv = hn::Load(d, s.b_value.at + n);
  const V focal = hn::Set(d, look.focal), one = hn::Set(d, 1.0f);
  const V on_screen_x = hn::Sub(bx, ax), on_screen_y = hn::Sub(by, ay);
  V ratio = one, ex = on_screen_x, ey = on_screen_y, ez = hn::Mul(hn::Sub(bv, av), focal);
  V radius_a = hn::Set(d, look.radius), radius_b = radius_a, of_b = radius_a;
  if constexpr (kPerspective) {
    const V more = hn::Div(hn::Sub(av, bv), bv);
    ratio = hn::Div(av, bv);
    ex = hn::Add(hn::Mul(ratio, ex), hn::Mul(more, hn::Sub(ax, hn::Set(d, look.middle_x))));
    ey = hn::Add(hn::Mul(ratio, ey), hn::Mul(more, hn::Sub(ay, hn::Set(d, look.middle_y))));
    ez = hn::Mul(more, focal);
    if (look.in_pixels) {
      radius_b = hn::Mul(radius_a, ratio);
    } else {
      of_b = hn::Mul(hn::Neg(bv), radius_a);
      radius_a = hn::Mul(hn::Neg(av), radius_a);
      radius_b = radius_a;
    }
  }
  const V length = hn::Sqrt(hn::Add(hn::Add(hn::Mul(ex, ex), hn::Mul(ey, ey)), hn::Mul(ez, ez)));
  const auto has_length = hn::Gt(length, hn::Set(d, CapsuleLook::kNoLength));
  const V per_length = hn::Div(one, length);
  const V ux = hn::IfThenElse(has_length, hn::Mul(ex, per_length), one),
          uy = hn::IfThenElseZero(has_length, hn::Mul(ey, per_length)),
          uz = hn::IfThenElseZero(has_length, hn::Mul(ez, per_length));
  hn::Store(ratio, d, s.ratio.at + n);
  hn::Store(ux, d, s.ux.at + n);
  hn::Store(uy, d, s.uy.at + n);
  hn::Store(uz, d, s.uz.at + n);
  const V end = hn::IfThenElseZero(has_length, length), endless = hn::Set(d, INFINITY);
  hn::Store(end, d, s.length.at + n);
  if (kPerspective && !look.in_pixels) {
    const V nearest = hn::Set(d, look.nearest);
    const auto cut_a = hn::And(has_length, hn::Eq(av, nearest)),
               cut_b = hn::And(has_length, hn::Eq(bv, nearest));
    hn::Store(hn::IfThenElseZero(cut_a, hn::Neg(endless)), d, s.begin.at + n);
    hn::Store(hn::IfThenElse(cut_b, endless, end), d, s.end.at + n);
  } else {
    hn::Store(hn::Zero(d), d, s.begin.at + n);
    hn::Store(end, d, s.end.at + n);
  }
  hn::Store(hn::IfThenElseZero(has_length, ez), d, s.end_z.at + n);
  hn::Store(radius_a, d, s.radius_a.at + n);
  hn::Store(radius_b, d, s.radius_b.at + n);
  hn::Store(hn::IfThenElseZero(has_length, hn::Mul(hn::Sub(radius_b, radius_a), per_length)), d,
            s.growth.at + n);
  const V sine2 = hn::Max(hn::Add(hn::Mul(ux, ux), hn::Mul(uy, uy)), hn::Set(d, CapsuleLook::kMinSine2));
  hn::Store(sine2, d, s.sine2.at + n);
  hn::Store(hn::Div(one, sine2), d, s.per_sine2.at + n);

  const Bounds bounds_a = boundsOf<kPerspective>(look, {ax, ay, av, radius_a}),
               bounds_b = boundsOf<kPerspective>(look, {bx, by, bv, of_b});
  const V reach_a = bounds_a.reach, reach_b = bounds_b.reach;
  hn::Store(hn::Min(bounds_a.least, bounds_b.least), d, s.least.at + n);
  const V on_screen = hn::Sqrt(hn::Add(hn::Mul(on_screen_x, on_screen_x), hn::Mul(on_screen_y, on_screen_y)));
  const V per_screen =
      hn::IfThenElseZero(hn::Gt(on_screen, hn::Set(d, CapsuleLook::kNoLength)), hn::Div(one, on_screen));
  hn::Store(hn::Mul(hn::Neg(on_screen_y), per_screen), d, s.across_x.at + n);
  hn::Store(hn::Mul(on_screen_x, per_screen), d, s.across_y.at + n);
  hn::Store(hn::Add(hn::Max(reach_a, reach_b), hn::Set(d, kOutermost)), d, s.reach.at + n);

  // Samples are less than half a pixel from the middle of theirs. Clamped before they are whole numbers.
  const auto firstOf = [&](V at_a, V at_b, int low, int high, int32_t* to) {
    const V at = hn::Floor(hn::Min(hn::Sub(at_a, reach_a), hn::Sub(at_b, reach_b)));
    const V within =
        hn::Min(hn::Max(at, hn::Set(d, static_cast<float>(low))), hn::Set(d, static_cast<float>(high) + 1));
    hn::Store(hn::ConvertTo(di, within), di, to);
  };
  const auto lastOf = [&](V at_a, V at_b, int low, int high, int32_t* to) {
    const V at = hn::Floor(hn::Max(hn::Add(at_a, reach_a), hn::Add(at_b, reach_b)));
    const V within =
        hn::Min(hn::Max(at, hn::Set(d, static_cast<float>(low) - 1)), hn::Set(d, static_cast<float>(high)));
    hn::Store(hn::ConvertTo(di, within), di, to);
  };
  firstOf(ax, bx, box.x0, box.x1, s.x0.at + n);
  firstOf(ay, by, box.y0, box.y1, s.y0.at + n);
  lastOf(ax, bx, box.x0, box.x1, s.x1.at + n);
  lastOf(ay, by, box.y0, box.y1, s.y1.at + n);
}

/// The rays of samples of one pixel, from the capsule's ends, which they meet.
struct Rays {
  S ax, ay, bx, by;  // from the first end; from the other one, of these only where needed
  S wx, wy;          // perspective: how far a ray goes aside for a step along the view
};

struct Meeting {
  S t;      // along the view, from the first end
  S chord;  // through the line, along the view, at most
};

/// Finds where rays meet a capsule; false: none does.
template <bool kPerspective, typename Mask>
HWY_INLINE bool meet(const Setups& s, size_t n, const Rays& r, Mask& meets, Meeting& out) {
  const Samples d;
  const S zero = hn::Zero(d);
  const S ux = hn::Set(d, s.ux.at[n]), uy = hn::Set(d, s.uy.at[n]), uz = hn::Set(d, s.uz.at[n]);
  const S length = hn::Set(d, s.length.at[n]), radius_a = hn::Set(d, s.radius_a.at[n]);
  S radius = radius_a, aside, sine2, per_sine2, t0, along0, wu;
  const S qu = hn::Add(hn::Mul(r.ax, ux), hn::Mul(r.ay, uy));
  if constexpr (kPerspective) {
    const S cx = hn::Sub(hn::Mul(r.wy, uz), uy), cy = hn::Sub(ux, hn::Mul(r.wx, uz)),
            cz = hn::Sub(hn::Mul(r.wx, uy), hn::Mul(r.wy, ux));
    sine2 = hn::Max(hn::Add(hn::Add(hn::Mul(cx, cx), hn::Mul(cy, cy)), hn::Mul(cz, cz)),
                    hn::Set(d, CapsuleLook::kMinSine2));
    per_sine2 = hn::Div(hn::Set(d, 1.0f), sine2);
    aside = hn::Add(hn::Mul(r.ax, cx), hn::Mul(r.ay, cy));
    wu = hn::Add(hn::Add(hn::Mul(r.wx, ux), hn::Mul(r.wy, uy)), uz);
    const S wq = hn::Add(hn::Mul(r.wx, r.ax), hn::Mul(r.wy, r.ay));
    t0 = hn::Mul(hn::Sub(hn::Mul(wu, qu), wq), per_sine2);
    along0 = hn::Add(qu, hn::Mul(t0, wu));
    radius = hn::Add(radius_a, hn::Mul(hn::Set(d, s.growth.at[n]), hn::Min(hn::Max(along0, zero), length)));
  } else {
    sine2 = hn::Set(d, s.sine2.at[n]);
    per_sine2 = hn::Set(d, s.per_sine2.at[n]);
    aside = hn::Sub(hn::Mul(r.ay, ux), hn::Mul(r.ax, uy));
    wu = uz;
    t0 = hn::Mul(hn::Mul(uz, qu), per_sine2);
    along0 = hn::Add(qu, hn::Mul(t0, uz));
  }
  const S left = hn::Sub(hn::Mul(hn::Mul(radius, radius), sine2), hn::Mul(aside, aside));
  meets = hn::And(meets, hn::Ge(left, zero));
  if (hn::AllFalse(d, meets)) return false;
  const S root = hn::Mul(hn::Sqrt(hn::Max(left, zero)), per_sine2);
  const S along = hn::Sub(along0, hn::Mul(root, wu));
  const auto beyond = hn::Gt(along, hn::Set(d, s.end.at[n]));
  const auto beside = hn::Or(hn::Lt(along, hn::Set(d, s.begin.at[n])), beyond);
  out.t = hn::Sub(t0, root);
  out.chord = hn::Mul(hn::Set(d, 3.0f), hn::Mul(radius, hn::Sqrt(per_sine2)));
  if (hn::AllFalse(d, hn::And(meets, beside))) return true;
  // The ball at one of its ends.
  const S x = hn::IfThenElse(beyond, r.bx, r.ax), y = hn::IfThenElse(beyond, r.by, r.ay);
  const S of_end = hn::IfThenElse(beyond, hn::Set(d, s.radius_b.at[n]), radius_a);
  S away2 = hn::Add(hn::Mul(x, x), hn::Mul(y, y)), ball, t;
  if constexpr (kPerspective) {
    const S ww = hn::Add(hn::Add(hn::Mul(r.wx, r.wx), hn::Mul(r.wy, r.wy)), hn::Set(d, 1.0f));
    const S turned = hn::Sub(hn::Mul(r.wx, y), hn::Mul(r.wy, x));
    ball = hn::Sub(hn::Mul(ww, hn::Mul(of_end, of_end)), hn::Add(away2, hn::Mul(turned, turned)));
    const S wq = hn::Add(hn::Mul(r.wx, x), hn::Mul(r.wy, y));
    t = hn::Neg(hn::Div(hn::Add(wq, hn::Sqrt(hn::Max(ball, zero))), ww));
  } else {
    ball = hn::Sub(hn::Mul(of_end, of_end), away2);
    t = hn::Neg(hn::Sqrt(hn::Max(ball, zero)));
  }
  t = hn::Add(t, hn::IfThenElseZero(beyond, hn::Set(d, s.end_z.at[n])));
  out.t = hn::IfThenElse(beside, t, out.t);
  meets = hn::And(meets, hn::Or(hn::Not(beside), hn::Ge(ball, zero)));
  return !hn::AllFalse(d, meets);
}

/// A capsule and its number.
struct Own {
  size_t n;  // in Setups
  uint32_t number;
  NumberRange inside;
};

struct Pixel {
  int x, y;
  PixelSamples& samples;
  const PixelSamples* before;  // may be null
};

template <bool kPerspective>
HWY_INLINE void drawPixel(const Setups& s, const Own& own, const CapsuleLook& look, const Pixel& at) {
  PixelSamples& pixel = at.samples;
  const Samples d;
  const SampleNumbers du;
  const size_t n = own.n;
  const S least = hn::Set(d, s.least.at[n]);
  const float middle_x = static_cast<float>(at.x) + 0.5f, middle_y = static_cast<float>(at.y) + 0.5f;
  for (size_t part = 0; part < kSamples; part += hn::Lanes(d)) {
    const S seen = hn::Load(d, pixel.values.data() + part);
    auto meets = hn::Ge(seen, least);
    if (hn::AllFalse(d, meets)) continue;
    const S sixteenth = hn::Set(d, 1.0f / 16), zero = hn::Zero(d);
    const S aside = hn::Mul(hn::Load(d, kSamplePlaces.x.data() + part), sixteenth),
            down = hn::Mul(hn::Load(d, kSamplePlaces.y.data() + part), sixteenth);
    const S ratio = hn::Set(d, s.ratio.at[n]);
    const auto from = [&](float middle, float end, S offset) {
      return hn::Add(hn::Set(d, middle - end), offset);
    };
    Rays rays{from(middle_x, s.ax.at[n], aside),
              from(middle_y, s.ay.at[n], down),
              from(middle_x, s.bx.at[n], aside),
              from(middle_y, s.by.at[n], down),
              zero,
              zero};
    if constexpr (kPerspective) {
      const S per_focal = hn::Set(d, 1.0f / look.focal);
      rays.bx = hn::Mul(ratio, rays.bx);
      rays.by = hn::Mul(ratio, rays.by);
      rays.wx = hn::Mul(from(middle_x, look.middle_x, aside), per_focal);
      rays.wy = hn::Mul(from(middle_y, look.middle_y, down), per_focal);
    }
    Meeting meeting{zero, zero};
    if (!meet<kPerspective>(s, n, rays, meets, meeting)) continue;
    const S per_focal = hn::Set(d, 1.0f / look.focal), a_value = hn::Set(d, s.a_value.at[n]);
    S value;
    if constexpr (kPerspective) {
      const S farther = hn::Add(hn::Set(d, 1.0f), hn::Mul(meeting.t, per_focal));
      value = hn::Div(a_value, farther);
      meets = hn::And(meets, hn::And(hn::Gt(farther, zero), hn::Ge(value, hn::Set(d, look.nearest))));
    } else {
      value = hn::Add(a_value, hn::Mul(meeting.t, per_focal));
    }
    value = hn::Max(value, least);
    const auto number = hn::Set(du, own.number), seen_number = hn::Load(du, pixel.numbers.data() + part);
    const auto same = hn::And(hn::Eq(value, seen), hn::RebindMask(d, hn::Lt(number, seen_number)));
    auto nearer = hn::And(meets, hn::Or(hn::Lt(value, seen), same));
    if (at.before) {
      const S bound = hn::Load(d, at.before->values.data() + part);
      const auto bound_number = hn::Load(du, at.before->numbers.data() + part);
      const auto after = hn::RebindMask(d, hn::Lt(bound_number, number));
      nearer = hn::And(nearer, hn::Or(hn::Lt(bound, value), hn::And(hn::Eq(bound, value), after)));
      S inside = hn::Mul(meeting.chord, per_focal);
      if constexpr (kPerspective) inside = hn::Mul(inside, hn::Abs(bound));
      const auto of_others = hn::Or(hn::Lt(bound_number, hn::Set(du, own.inside.first)),
                                    hn::Lt(hn::Set(du, own.inside.last), bound_number));
      const auto of_line = hn::RebindMask(d, hn::Not(of_others));
      nearer = hn::AndNot(hn::And(of_line, hn::Le(hn::Sub(value, bound), inside)), nearer);
    }
    hn::Store(hn::IfThenElse(nearer, value, seen), d, pixel.values.data() + part);
    hn::Store(hn::IfThenElse(hn::RebindMask(du, nearer), number, seen_number), du,
              pixel.numbers.data() + part);
  }
}

/// The farthest value of a block.
HWY_INLINE float farthestOf(const SampleBox& box, int column, int row) {
  const Samples d;
  constexpr int kSide = TileDepths::kSide;
  const int columns = box.x1 - box.x0 + 1, rows = box.y1 - box.y0 + 1;
  const int x0 = column * kSide, x1 = x0 + kSide < columns ? x0 + kSide : columns;
  const int y0 = row * kSide, y1 = y0 + kSide < rows ? y0 + kSide : rows;
  S farthest = hn::Set(d, -INFINITY);
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x)
      for (size_t part = 0; part < kSamples; part += hn::Lanes(d))
        farthest = hn::Max(farthest, hn::Load(d, box.samples[y * kSampleTileWidth + x].values.data() + part));
  return hn::GetLane(hn::MaxOfLanes(d, farthest));
}

/// Blocks of the tile, the last included.
struct BlockBox {
  int x0, y0, x1, y1;
};

/// Whether a capsule lies behind what all pixels of its blocks see; brings those up to date of which many changed.
HWY_INLINE bool isHidden(const BlockBox& blocks, float least, const SampleBox& box, TileDepths& depths) {
  for (int row = blocks.y0; row <= blocks.y1; ++row)
    for (int column = blocks.x0; column <= blocks.x1; ++column) {
      const auto block = static_cast<size_t>(row * TileDepths::kColumns + column);
      if (depths.farthest[block] < least) continue;
      if (depths.stale[block] < TileDepths::kSide * TileDepths::kSide) return false;
      depths.stale[block] = 0;
      depths.farthest[block] = farthestOf(box, column, row);
      if (!(depths.farthest[block] < least)) return false;
    }
  return true;
}

template <bool kPerspective>
HWY_INLINE void fill(const Setups& s, const Own& own, const CapsuleLook& look, const SampleBox& box,
                     TileDepths& depths) {
  const size_t n = own.n;
  if (s.x0.at[n] > s.x1.at[n] || s.y0.at[n] > s.y1.at[n]) return;
  constexpr int kSide = TileDepths::kSide;
  const BlockBox blocks{(s.x0.at[n] - box.x0) / kSide, (s.y0.at[n] - box.y0) / kSide,
                        (s.x1.at[n] - box.x0) / kSide, (s.y1.at[n] - box.y0) / kSide};
  if (isHidden(blocks, s.least.at[n], box, depths)) return;
  const int pixels = (s.x1.at[n] - s.x0.at[n] + 1) * (s.y1.at[n] - s.y0.at[n] + 1) / 2;
  for (int row = blocks.y0; row <= blocks.y1; ++row)
    for (int column = blocks.x0; column <= blocks.x1; ++column)
      depths.stale[static_cast<size_t>(row * TileDepths::kColumns + column)] += pixels < 64 ? pixels : 64;
  const float across_x = s.across_x.at[n], reach = s.reach.at[n];
  // The strip has no sides to the left and right, where it is nearly level.
  const bool has_sides = across_x * across_x > 1e-6f;
  const float per_across = has_sides ? 1 / across_x : 0,
              half = has_sides ? reach * (per_across < 0 ? -per_across : per_across) : 0;
  const auto first = static_cast<float>(s.x0.at[n]), last = static_cast<float>(s.x1.at[n]);
  for (int y = s.y0.at[n]; y <= s.y1.at[n]; ++y) {
    int x0 = s.x0.at[n], x1 = s.x1.at[n];
    if (has_sides) {
      const float middle =
          s.ax.at[n] - 0.5f - (static_cast<float>(y) + 0.5f - s.ay.at[n]) * s.across_y.at[n] * per_across;
      const float left = middle - half, right = middle + half;
      if (!(left <= last && right >= first)) continue;
      x0 = static_cast<int>(left > first ? left : first);
      x1 = static_cast<int>(right < last ? right + 1 : last);
      if (x1 > s.x1.at[n]) x1 = s.x1.at[n];
    }
    const ptrdiff_t row = ptrdiff_t{y - box.y0} * kSampleTileWidth - box.x0;
    for (int x = x0; x <= x1; ++x)
      drawPixel<kPerspective>(s, own, look,
                              {x, y, box.samples[row + x], box.before ? box.before + row + x : nullptr});
  }
}

template <bool kPerspective>
HWY_INLINE void drawAll(const CapsuleWork& work, const CapsuleLook& look, const SampleBox& box) {
  Setups setups;
  for (size_t begin = 0; begin < work.capsules.size(); begin += kAtOnce) {
    gatherEnds(work, begin, setups);
    for (size_t n = 0; n < kAtOnce; n += hn::Lanes(Floats())) setUp<kPerspective>(look, box, n, setups);
    for (size_t n = 0; n < kAtOnce && begin + n < work.capsules.size(); ++n)
      fill<kPerspective>(setups, {n, work.numbers[begin + n], work.insides[begin + n]}, look, box,
                         work.depths);
  }
}

void drawCapsules(const CapsuleWork& work, const CapsuleLook& look, const SampleBox& box) {
  if (look.perspective)
    drawAll<true>(work, look, box);
  else
    drawAll<false>(work, look, box);
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(drawCapsules);

void drawCapsules(const CapsuleWork& work, const CapsuleLook& look, const SampleBox& box) {
  HWY_DYNAMIC_DISPATCH(drawCapsules)(work, look, box);
}

}  // namespace curvisplat
#endif
