#include "render/surface/rasterizer.h"

// The code from here to HWY_AFTER_NAMESPACE is compiled once for every instruction set that a processor may
// have.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/surface/small_triangles.cpp"
#include <hwy/foreach_target.h>  // before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kAtOnce = 16;
constexpr int kGridBits = 4;          // 1/16 pixel
constexpr float kFarthest = 1 << 20;  // pixels: grid coordinates are exact
constexpr float kMinArea = 1e-9f;     // square pixels: below it a triangle's plane is rounding error
using Floats = hn::CappedTag<float, kAtOnce>;
using Ints = hn::RebindToSigned<Floats>;
using Samples = hn::CappedTag<float, kSamples>;
using SampleNumbers = hn::RebindToUnsigned<Samples>;

/// Sixteen triangles, ready to be filled.
struct Setups {
  struct alignas(64) Row {
    float at[kAtOnce];
  };
  struct alignas(64) IntRow {
    int32_t at[kAtOnce];
  };
  Row x[3], y[3], value[3];  // corners, in pixels
  IntRow x0, y0, x1, y1;     // pixels, the last included; x1 < x0: nothing
  IntRow is_small;           // 0: not
  Row a[3], b[3], edge[3];   // edge functions a sx + b sy + edge at the centre of (x0, y0); sx, sy in 1/16
  Row middle, by_x, by_y;    // of the value, there and over a pixel
  Row least, most;           // of the corners' values
};

HWY_INLINE void gatherCorners(const SmallTriangles& work, size_t begin, Setups& out) {
  for (size_t n = 0; n < kAtOnce; ++n) {
    const auto& corners = work.triangles[work.numbers[begin + n < work.numbers.size() ? begin + n : begin]];
    for (size_t c = 0; c < 3; ++c) {
      const ScreenVertex& vertex = work.vertices[corners[c]];
      out.x[c].at[n] = vertex.x;
      out.y[c].at[n] = vertex.y;
      out.value[c].at[n] = vertex.value;
    }
  }
}

/// Lanes `n` and on.
HWY_INLINE void setUp(const SampleBox& box, size_t n, Setups& s) {
  const Floats d;
  const Ints di;
  using V = hn::Vec<Floats>;
  using I = hn::Vec<Ints>;
  const V x0 = hn::Load(d, s.x[0].at + n), x1 = hn::Load(d, s.x[1].at + n), x2 = hn::Load(d, s.x[2].at + n);
  const V y0 = hn::Load(d, s.y[0].at + n), y1 = hn::Load(d, s.y[1].at + n), y2 = hn::Load(d, s.y[2].at + n);
  const V v0 = hn::Load(d, s.value[0].at + n), v1 = hn::Load(d, s.value[1].at + n),
          v2 = hn::Load(d, s.value[2].at + n);
  const V farthest = hn::Max(hn::Max(hn::Max(hn::Abs(x0), hn::Abs(x1)), hn::Max(hn::Abs(x2), hn::Abs(y0))),
                             hn::Max(hn::Abs(y1), hn::Abs(y2)));
  const V sum = hn::Add(v0, hn::Add(v1, v2));
  const auto known = hn::And(hn::Le(farthest, hn::Set(d, kFarthest)), hn::Eq(sum, sum));

  const V grid = hn::Set(d, 1 << kGridBits);
  const I gx0 = hn::NearestInt(hn::Mul(x0, grid)), gx1 = hn::NearestInt(hn::Mul(x1, grid)),
          gx2 = hn::NearestInt(hn::Mul(x2, grid));
  const I gy0 = hn::NearestInt(hn::Mul(y0, grid)), gy1 = hn::NearestInt(hn::Mul(y1, grid)),
          gy2 = hn::NearestInt(hn::Mul(y2, grid));
  const I least_x = hn::Min(gx0, hn::Min(gx1, gx2)), most_x = hn::Max(gx0, hn::Max(gx1, gx2));
  const I least_y = hn::Min(gy0, hn::Min(gy1, gy2)), most_y = hn::Max(gy0, hn::Max(gy1, gy2));
  const I side = hn::Set(di, kSmallTriangle << kGridBits);
  const auto is_small = hn::AndNot(hn::Gt(hn::Max(hn::Sub(most_x, least_x), hn::Sub(most_y, least_y)), side),
                                   hn::RebindMask(di, known));
  hn::Store(hn::IfThenElseZero(is_small, hn::Set(di, 1)), di, s.is_small.at + n);

  // The outermost samples are 7/16 from the centre.
  const I one = hn::Set(di, 1);
  const I px0 = hn::Max(hn::Set(di, box.x0), hn::ShiftRight<kGridBits>(hn::Sub(least_x, one)));
  const I py0 = hn::Max(hn::Set(di, box.y0), hn::ShiftRight<kGridBits>(hn::Sub(least_y, one)));
  const I px1 = hn::Min(hn::Set(di, box.x1), hn::ShiftRight<kGridBits>(most_x));
  const I py1 = hn::Min(hn::Set(di, box.y1), hn::ShiftRight<kGridBits>(most_y));
  const I area =
      hn::Sub(hn::Mul(hn::Sub(gx1, gx0), hn::Sub(gy2, gy0)), hn::Mul(hn::Sub(gy1, gy0), hn::Sub(gx2, gx0)));
  const I zero = hn::Zero(di);
  const auto drawn = hn::And(is_small, hn::Not(hn::Eq(area, zero)));
  hn::Store(px0, di, s.x0.at + n);
  hn::Store(py0, di, s.y0.at + n);
  hn::Store(hn::IfThenElse(drawn, px1, hn::Sub(px0, one)), di, s.x1.at + n);
  hn::Store(py1, di, s.y1.at + n);

  // Positive on the inner side, and on the edge itself for top and left edges.
  const auto turned = hn::Lt(area, zero);
  const I centre_x = hn::Add(hn::ShiftLeft<kGridBits>(px0), hn::Set(di, 1 << (kGridBits - 1)));
  const I centre_y = hn::Add(hn::ShiftLeft<kGridBits>(py0), hn::Set(di, 1 << (kGridBits - 1)));
  const I from_x[3] = {gx0, gx1, gx2}, from_y[3] = {gy0, gy1, gy2};
  for (size_t edge = 0; edge < 3; ++edge) {
    const size_t next = edge == 2 ? 0 : edge + 1;
    I a = hn::Sub(from_y[edge], from_y[next]), b = hn::Sub(from_x[next], from_x[edge]);
    a = hn::IfThenElse(turned, hn::Neg(a), a);
    b = hn::IfThenElse(turned, hn::Neg(b), b);
    const auto takes_edge = hn::Or(hn::Gt(a, zero), hn::And(hn::Eq(a, zero), hn::Gt(b, zero)));
    const I at =
        hn::Add(hn::Mul(a, hn::Sub(centre_x, from_x[edge])), hn::Mul(b, hn::Sub(centre_y, from_y[edge])));
    const V bias = hn::IfThenElse(hn::RebindMask(d, takes_edge), hn::Zero(d), hn::Set(d, -0.5f));
    hn::Store(hn::ConvertTo(d, a), d, s.a[edge].at + n);
    hn::Store(hn::ConvertTo(d, b), d, s.b[edge].at + n);
    hn::Store(hn::Add(hn::ConvertTo(d, at), bias), d, s.edge[edge].at + n);
  }

  // The value's plane is the exact triangle's, where that has an area, and goes no further than its corners.
  const V dx1 = hn::Sub(x1, x0), dy1 = hn::Sub(y1, y0), dx2 = hn::Sub(x2, x0), dy2 = hn::Sub(y2, y0);
  const V dv1 = hn::Sub(v1, v0), dv2 = hn::Sub(v2, v0);
  const V exact = hn::Sub(hn::Mul(dx1, dy2), hn::Mul(dy1, dx2));
  const V per_area =
      hn::IfThenElseZero(hn::Gt(hn::Abs(exact), hn::Set(d, kMinArea)), hn::Div(hn::Set(d, 1.0f), exact));
  const V by_x = hn::Mul(hn::Sub(hn::Mul(dv1, dy2), hn::Mul(dv2, dy1)), per_area);
  const V by_y = hn::Mul(hn::Sub(hn::Mul(dv2, dx1), hn::Mul(dv1, dx2)), per_area);
  const V half = hn::Set(d, 0.5f);
  const V to_x = hn::Sub(hn::Add(hn::ConvertTo(d, px0), half), x0);
  const V to_y = hn::Sub(hn::Add(hn::ConvertTo(d, py0), half), y0);
  hn::Store(hn::Add(v0, hn::Add(hn::Mul(by_x, to_x), hn::Mul(by_y, to_y))), d, s.middle.at + n);
  hn::Store(by_x, d, s.by_x.at + n);
  hn::Store(by_y, d, s.by_y.at + n);
  hn::Store(hn::Min(v0, hn::Min(v1, v2)), d, s.least.at + n);
  hn::Store(hn::Max(v0, hn::Max(v1, v2)), d, s.most.at + n);
}

HWY_INLINE void fill(const Setups& s, size_t n, uint32_t number, const SampleBox& box) {
  const Samples d;
  const SampleNumbers du;
  const size_t lanes = hn::Lanes(d);
  alignas(64) float edges[3][kSamples], values[kSamples];
  for (size_t part = 0; part < kSamples; part += lanes) {
    const auto x = hn::Load(d, kSamplePlaces.x.data() + part), y = hn::Load(d, kSamplePlaces.y.data() + part);
    for (size_t edge = 0; edge < 3; ++edge)
      hn::Store(hn::Add(hn::Mul(hn::Set(d, s.a[edge].at[n]), x), hn::Mul(hn::Set(d, s.b[edge].at[n]), y)), d,
                edges[edge] + part);
    const auto sixteenth = hn::Set(d, 1.0f / (1 << kGridBits));
    hn::Store(hn::Mul(hn::Add(hn::Mul(hn::Set(d, s.by_x.at[n]), x), hn::Mul(hn::Set(d, s.by_y.at[n]), y)),
                      sixteenth),
              d, values + part);
  }
  const auto least = hn::Set(d, s.least.at[n]), most = hn::Set(d, s.most.at[n]);
  const auto own = hn::Set(du, number);
  const int x0 = s.x0.at[n], y0 = s.y0.at[n];
  constexpr float kPixel = 1 << kGridBits;
  for (int y = y0; y <= s.y1.at[n]; ++y) {
    const auto down = static_cast<float>(y - y0);
    const ptrdiff_t first = ptrdiff_t{y - box.y0} * kSampleTileWidth + (x0 - box.x0);
    PixelSamples* pixel = box.samples + first;
    for (int x = x0; x <= s.x1.at[n]; ++x, ++pixel) {
      const auto across = static_cast<float>(x - x0);
      float at[3];
      for (size_t edge = 0; edge < 3; ++edge)
        at[edge] = s.edge[edge].at[n] + kPixel * (s.a[edge].at[n] * across + s.b[edge].at[n] * down);
      const float middle = s.middle.at[n] + (s.by_x.at[n] * across + s.by_y.at[n] * down);
      for (size_t part = 0; part < kSamples; part += lanes) {
        const auto inside = hn::Ge(hn::Min(hn::Add(hn::Set(d, at[0]), hn::Load(d, edges[0] + part)),
                                           hn::Min(hn::Add(hn::Set(d, at[1]), hn::Load(d, edges[1] + part)),
                                                   hn::Add(hn::Set(d, at[2]), hn::Load(d, edges[2] + part)))),
                                   hn::Zero(d));
        if (hn::AllFalse(d, inside)) continue;
        const auto value =
            hn::Min(hn::Max(hn::Add(hn::Set(d, middle), hn::Load(d, values + part)), least), most);
        const auto seen = hn::Load(d, pixel->values.data() + part);
        const auto seen_number = hn::Load(du, pixel->numbers.data() + part);
        const auto same = hn::And(hn::Eq(value, seen), hn::RebindMask(d, hn::Lt(own, seen_number)));
        auto nearer = hn::And(inside, hn::Or(hn::Lt(value, seen), same));
        if (box.before) {
          const PixelSamples& before = box.before[pixel - box.samples];
          const auto bound = hn::Load(d, before.values.data() + part);
          const auto after = hn::RebindMask(d, hn::Lt(hn::Load(du, before.numbers.data() + part), own));
          nearer = hn::And(nearer, hn::Or(hn::Lt(bound, value), hn::And(hn::Eq(bound, value), after)));
        }
        hn::Store(hn::IfThenElse(nearer, value, seen), d, pixel->values.data() + part);
        hn::Store(hn::IfThenElse(hn::RebindMask(du, nearer), own, seen_number), du,
                  pixel->numbers.data() + part);
      }
    }
  }
}

size_t drawSmallTriangles(const SmallTriangles& work, const SampleBox& box, uint32_t* left) {
  Setups setups;
  size_t left_count = 0;
  for (size_t begin = 0; begin < work.numbers.size(); begin += kAtOnce) {
    gatherCorners(work, begin, setups);
    for (size_t n = 0; n < kAtOnce; n += hn::Lanes(Floats())) setUp(box, n, setups);
    for (size_t n = 0; n < kAtOnce && begin + n < work.numbers.size(); ++n) {
      const uint32_t triangle = work.numbers[begin + n];
      if (setups.is_small.at[n])
        fill(setups, n, work.first_number + triangle, box);
      else
        left[left_count++] = triangle;
    }
  }
  return left_count;
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(drawSmallTriangles);

size_t drawSmallTriangles(const SmallTriangles& work, const SampleBox& box, uint32_t* left) {
  return HWY_DYNAMIC_DISPATCH(drawSmallTriangles)(work, box, left);
}

}  // namespace curvisplat
#endif
