#include "preprocess/splats/inner_nodes.h"

#include "preprocess/shape/shape.h"

// The code from here to HWY_AFTER_NAMESPACE is compiled once for every instruction set that a processor may
// have.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "preprocess/splats/inner_nodes.cpp"
#include <hwy/foreach_target.h>  // before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kAtOnce = kInnerNodesAtOnce;
using Doubles = hn::CappedTag<double, kAtOnce>;
using Singles = hn::Rebind<float, Doubles>;
using V = hn::Vec<Doubles>;

/// A vector of space for each lane.
struct V3 {
  V x, y, z;
};

HWY_INLINE V number(double value) {
  return hn::Set(Doubles(), value);
}
HWY_INLINE V load(const float* from) {
  return hn::PromoteTo(Doubles(), hn::LoadU(Singles(), from));
}
HWY_INLINE V3 load(const NodePositions& from, ptrdiff_t at) {
  const Doubles d;
  return {hn::LoadU(d, from.x + at), hn::LoadU(d, from.y + at), hn::LoadU(d, from.z + at)};
}
HWY_INLINE V3 operator+(const V3& a, const V3& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE V3 operator-(const V3& a, const V3& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE V3 times(V factor, const V3& v) {
  return {hn::Mul(factor, v.x), hn::Mul(factor, v.y), hn::Mul(factor, v.z)};
}
HWY_INLINE V sum(V a, V b, V c) {
  return hn::Add(hn::Add(a, b), c);
}
HWY_INLINE V dot(const V3& a, const V3& b) {
  return sum(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y), hn::Mul(a.z, b.z));
}
HWY_INLINE V length(const V3& v) {
  return hn::Sqrt(dot(v, v));
}
/// The smaller of two numbers, as std::min() finds it: `a` if both are zeros.
HWY_INLINE V smaller(V a, V b) {
  return hn::IfThenElse(hn::Lt(b, a), b, a);
}
HWY_INLINE V larger(V a, V b) {
  return hn::IfThenElse(hn::Lt(a, b), b, a);
}
/// -1 for v < 0, else 1.
HWY_INLINE V signOf(V v) {
  return hn::IfThenElse(hn::Lt(v, number(0)), number(-1), number(1));
}

/// The factors of LqFactors, for rows without a zero; lanes with one get numbers that are not above the
/// floor.
struct Factors {
  V a00, a10, a11, a20, a21, a22;
  V inverse_a00, inverse_a11, determinant;
  V3 reflector;
  V scale, first_sign, cosine, sine, last_sign;

  HWY_INLINE Factors(const V3& x, const V3& y, const V3& z) {
    a00 = length(x);
    const V side = signOf(x.x);
    reflector = {hn::Add(x.x, hn::Mul(side, a00)), x.y, x.z};
    inverse_a00 = hn::Div(number(1), a00);
    scale = hn::Div(inverse_a00, hn::Add(a00, hn::Abs(x.x)));
    first_sign = hn::Neg(side);

    const V3 y1 = reflect(y), z1 = reflect(z);
    a10 = y1.x;
    a20 = z1.x;
    a11 = hn::Sqrt(hn::Add(hn::Mul(y1.y, y1.y), hn::Mul(y1.z, y1.z)));
    inverse_a11 = hn::Div(number(1), a11);
    cosine = hn::Mul(y1.y, inverse_a11);
    sine = hn::Mul(y1.z, inverse_a11);
    const V third = hn::Sub(hn::Mul(cosine, z1.z), hn::Mul(sine, z1.y));
    last_sign = signOf(third);
    a21 = hn::Add(hn::Mul(cosine, z1.y), hn::Mul(sine, z1.z));
    a22 = hn::Abs(third);
    determinant = hn::Mul(hn::Mul(hn::Mul(side, a00), a11), third);
  }

  HWY_INLINE V3 reflect(const V3& v) const {
    const V along = hn::Mul(scale, dot(v, reflector));
    return {hn::Mul(first_sign, hn::Sub(v.x, hn::Mul(along, reflector.x))),
            hn::Sub(v.y, hn::Mul(along, reflector.y)), hn::Sub(v.z, hn::Mul(along, reflector.z))};
  }
  HWY_INLINE V3 rotate(const V3& v) const {
    const V3 r = reflect(v);
    return {r.x, hn::Add(hn::Mul(cosine, r.y), hn::Mul(sine, r.z)),
            hn::Mul(last_sign, hn::Sub(hn::Mul(cosine, r.z), hn::Mul(sine, r.y)))};
  }
  /// Transforms as PlainFrame::inFrame() does.
  HWY_INLINE V3 inFrame(const V3& v) const {
    const V v0 = hn::Mul(v.x, inverse_a00);
    const V v1 = hn::Mul(hn::Sub(v.y, hn::Mul(a10, v0)), inverse_a11);
    return {v0, v1, hn::Div(hn::Sub(hn::Sub(v.z, hn::Mul(a20, v0)), hn::Mul(a21, v1)), a22)};
  }
};

HWY_INLINE void put(const V3& v, double (&to)[3][kAtOnce], size_t lane) {
  const Doubles d;
  hn::Store(v.x, d, to[0] + lane);
  hn::Store(v.y, d, to[1] + lane);
  hn::Store(v.z, d, to[2] + lane);
}

/// A scalar's values, in rows of lanes.
struct alignas(64) StagedScalar {
  double mean[kAtOnce], slope[3][kAtOnce];
};

/// The numbers of the geometry that the scalars need.
struct Cells {
  V3 stretch, middle, bend_in_cells, aside_in_cells;
  std::array<V, 3> stretch2;
};

/// Does what asideOf() (block_window.h) does.
HWY_INLINE V3 asideOf(const V3& to_before, const V3& to_after, V before, V after) {
  const V both = hn::Add(before, after), share = hn::Div(before, both);
  const V3 aside = times(number(0.25), times(share, to_after) - times(hn::Sub(number(1), share), to_before));
  const auto has_length = hn::Gt(both, number(0));
  return {hn::IfThenElseZero(has_length, aside.x), hn::IfThenElseZero(has_length, aside.y),
          hn::IfThenElseZero(has_length, aside.z)};
}

HWY_INLINE V3 cross(const V3& a, const V3& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(b.y, a.z)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(b.z, a.x)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(b.x, a.y))};
}

/// The volume that gentleVolume() (dual_cell.cpp) finds, from the same differences along the axes.
/// `growth`: as widthGrowth() (dual_cell.h).
HWY_INLINE V gentleVolume(const InnerRow& row, ptrdiff_t at, const V3 (&x)[3], const V3 (&xx)[3],
                          V (&growth)[3]) {
  V3 mixed[3], third[3];
  for (size_t p = 0; p < 3; ++p) third[p] = times(number(-4), x[p]);
  for (size_t r = 0; r < 3; ++r) {
    const size_t p = (r + 1) % 3, q = (r + 2) % 3;
    const ptrdiff_t sum = row.strides[p] + row.strides[q], difference = row.strides[p] - row.strides[q];
    const V3 after = load(row.positions, at + sum), before = load(row.positions, at - sum),
             aside = load(row.positions, at + difference), other = load(row.positions, at - difference);
    const V3 a = after - before, b = aside - other;
    mixed[r] = times(number(0.25), (after + before) - (aside + other));
    third[p] = third[p] + times(number(0.5), a + b);
    third[q] = third[q] + times(number(0.5), a - b);
  }
  V correction = hn::Zero(Doubles());
  const V3 area[3] = {cross(x[1], x[2]), cross(x[2], x[0]), cross(x[0], x[1])};
  const V volume = dot(x[0], area[0]);
  for (V& of_axis : growth) of_axis = hn::Zero(Doubles());
  for (size_t r = 0; r < 3; ++r) {
    const size_t p = (r + 1) % 3, q = (r + 2) % 3;
    growth[p] = hn::Add(growth[p], dot(area[q], mixed[r]));
    growth[q] = hn::Add(growth[q], dot(area[p], mixed[r]));
  }
  for (V& of_axis : growth)
    of_axis = hn::IfThenElseZero(hn::Ne(volume, hn::Zero(Doubles())),
                                 smaller(larger(hn::Div(of_axis, volume), number(-1)), number(1)));
  for (size_t p = 0; p < 3; ++p) {
    const size_t q = (p + 1) % 3, r = (p + 2) % 3;
    const V3 bent =
        (cross(mixed[p], xx[r]) + cross(xx[q], mixed[p])) + times(number(0.5), cross(mixed[r], mixed[q]));
    correction = hn::Add(correction, hn::Add(dot(third[p], area[p]), dot(x[p], bent)));
  }
  correction = hn::Mul(correction, number(0.125));
  const auto is_gentle = hn::Le(hn::Abs(correction), hn::Mul(number(kMaxCorrection), hn::Abs(volume)));
  return hn::IfThenElseZero(is_gentle, hn::Add(volume, correction));
}

/// Stages the geometry of nodes `node` and on.
HWY_INLINE Factors stageGeometry(const InnerRow& row, size_t node, size_t lane, InnerSplats& out,
                                 Cells& cells) {
  const Doubles d;
  const V zero = hn::Zero(d);
  const ptrdiff_t at = row.at + static_cast<ptrdiff_t>(node);
  const V3 here = load(row.positions, at);
  V3 jacobian[3], second[3], bend{zero, zero, zero}, aside{zero, zero, zero};
  V stretch[3], middle[3];
  V distance[3][2];  // to the neighbours along an axis, across the faces
  V3 to_neighbours[3][2];
  for (size_t axis = 0; axis < 3; ++axis) {
    const V3 before = load(row.positions, at - row.strides[axis]),
             after = load(row.positions, at + row.strides[axis]);
    jacobian[axis] = times(number(0.5), after - before);
    const V3 to_before = here - before, to_after = after - here;
    to_neighbours[axis][0] = to_before;
    to_neighbours[axis][1] = to_after;
    second[axis] = to_after - to_before;
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    const V3 across = cross(jacobian[(axis + 1) % 3], jacobian[(axis + 2) % 3]);
    for (size_t side = 0; side < 2; ++side)
      distance[axis][side] = hn::Abs(dot(to_neighbours[axis][side], across));
  }
  V growth[3];
  hn::Store(hn::Abs(gentleVolume(row, at, jacobian, second, growth)), d, out.weight + lane);
  for (size_t axis = 0; axis < 3; ++axis) {
    const V a = distance[axis][0], b = distance[axis][1], both = hn::Add(a, b);
    const V narrower = hn::Sub(number(1), hn::Mul(number(kWidthShare), hn::Mul(growth[axis], growth[axis])));
    stretch[axis] = hn::Mul(load(row.stretch[axis] + node), narrower);
    cells.stretch2[axis] = hn::Mul(stretch[axis], stretch[axis]);
    bend = bend + times(cells.stretch2[axis], second[axis]);
    aside = aside + asideOf(to_neighbours[axis][0], to_neighbours[axis][1], a, b);
    const V beside =
        hn::IfThenElseZero(hn::Gt(both, zero), hn::Div(hn::Mul(number(0.5), hn::Sub(b, a)), both));
    middle[axis] =
        hn::Add(hn::Add(beside, load(row.drift[axis] + node)), hn::Mul(number(kWidthDrift), growth[axis]));
  }
  const V3 moved{sum(hn::Mul(jacobian[0].x, middle[0]), hn::Mul(jacobian[1].x, middle[1]),
                     hn::Mul(jacobian[2].x, middle[2])),
                 sum(hn::Mul(jacobian[0].y, middle[0]), hn::Mul(jacobian[1].y, middle[1]),
                     hn::Mul(jacobian[2].y, middle[2])),
                 sum(hn::Mul(jacobian[0].z, middle[0]), hn::Mul(jacobian[1].z, middle[1]),
                     hn::Mul(jacobian[2].z, middle[2]))};
  put(here + moved + aside, out.position, lane);
  for (size_t axis = 0; axis < 3; ++axis) jacobian[axis] = times(stretch[axis], jacobian[axis]);

  const Factors lq({jacobian[0].x, jacobian[1].x, jacobian[2].x},
                   {jacobian[0].y, jacobian[1].y, jacobian[2].y},
                   {jacobian[0].z, jacobian[1].z, jacobian[2].z});
  put({lq.a00, lq.a11, lq.a22}, out.axis, lane);
  put({hn::Mul(lq.a10, lq.inverse_a00), hn::Mul(lq.a20, lq.inverse_a00), hn::Mul(lq.a21, lq.inverse_a11)},
      out.shear, lane);
  hn::Store(lq.determinant, d, out.determinant + lane);
  const V one = number(1);
  put(lq.rotate({one, zero, zero}), out.rotated[0], lane);
  put(lq.rotate({zero, one, zero}), out.rotated[1], lane);
  put(lq.rotate({zero, zero, one}), out.rotated[2], lane);
  const V lower[6] = {lq.a00, lq.a10, lq.a11, lq.a20, lq.a21, lq.a22};
  for (size_t n = 0; n < 6; ++n) hn::Store(lower[n], d, out.lower[n] + lane);

  cells.stretch = {stretch[0], stretch[1], stretch[2]};
  cells.middle = {middle[0], middle[1], middle[2]};
  const V3 in_cells = lq.inFrame(bend);
  const V limit = number(kMaxBend);
  const V largest = larger(larger(hn::Abs(in_cells.x), hn::Abs(in_cells.y)), hn::Abs(in_cells.z));
  const V share = hn::Div(limit, larger(limit, largest));
  cells.bend_in_cells = times(share, in_cells);
  cells.aside_in_cells = times(share, lq.inFrame(aside));
  return lq;
}

HWY_INLINE void stageScalar(const InnerRow& row, const float* at, const Cells& cells, const Factors& lq,
                            size_t lane, StagedScalar& out) {
  const Doubles d;
  const V here = load(at);
  V gradient[3], second = hn::Zero(d), least = here, most = here;
  for (size_t axis = 0; axis < 3; ++axis) {
    const V before = load(at - row.strides[axis]), after = load(at + row.strides[axis]);
    gradient[axis] = hn::Mul(number(0.5), hn::Sub(after, before));
    second =
        hn::Add(second, hn::Mul(cells.stretch2[axis], hn::Sub(hn::Sub(after, here), hn::Sub(here, before))));
    least = smaller(smaller(least, before), after);
    most = larger(larger(most, before), after);
  }
  const V3 change{gradient[0], gradient[1], gradient[2]};
  const V3 slope = lq.rotate({hn::Mul(change.x, cells.stretch.x), hn::Mul(change.y, cells.stretch.y),
                              hn::Mul(change.z, cells.stretch.z)});
  const V mean = hn::Add(hn::Add(here, dot(change, cells.middle)), dot(slope, cells.aside_in_cells));
  const V corrected =
      hn::Add(mean, hn::Mul(number(row.bend), hn::Sub(second, dot(slope, cells.bend_in_cells))));
  hn::Store(smaller(larger(corrected, least), most), d, out.mean + lane);
  put(slope, out.slope, lane);
}

void computeInnerNodes(const InnerRow& row, size_t first, InnerSplats& out, SplatScalar* values) {
  constexpr size_t kLanes = hn::MaxLanes(Doubles());
  const size_t scalars = row.scalars.size();
  StagedScalar staged;
  for (size_t lane = 0; lane < kAtOnce; lane += kLanes) {
    Cells cells;
    const Factors lq = stageGeometry(row, first + lane, lane, out, cells);
    const ptrdiff_t at = row.at + static_cast<ptrdiff_t>(first + lane);
    for (size_t s = 0; s < scalars; ++s) {
      stageScalar(row, row.scalars[s] + at, cells, lq, lane, staged);
      for (size_t n = lane; n < lane + kLanes; ++n)
        values[n * scalars + s] = {
            staged.mean[n], {staged.slope[0][n], staged.slope[1][n], staged.slope[2][n]}, 0.0};
    }
  }
  for (size_t n = 0; n < kAtOnce; ++n)
    out.is_plain[n] =
        out.weight[n] > 0 && surelyAboveFloor({out.lower[0][n], out.lower[1][n], out.lower[2][n],
                                               out.lower[3][n], out.lower[4][n], out.lower[5][n]});
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(computeInnerNodes);

void computeInnerNodes(const InnerRow& row, size_t first, InnerSplats& out, SplatScalar* values) {
  HWY_DYNAMIC_DISPATCH(computeInnerNodes)(row, first, out, values);
}

}  // namespace curvisplat
#endif
