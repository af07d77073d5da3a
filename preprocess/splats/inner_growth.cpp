#include "preprocess/splats/inner_nodes.h"

#include "stream/model/growth_code.h"

// The code from here to HWY_AFTER_NAMESPACE is compiled once for every instruction set that a processor may
// have.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "preprocess/splats/inner_growth.cpp"
#include <hwy/foreach_target.h>  // before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, kInnerNodesAtOnce>;
using V = hn::Vec<Doubles>;

HWY_INLINE V number(double value) {
  return hn::Set(Doubles(), value);
}
/// Rounds as std::nearbyint() does; the numbers are far below 2^51.
HWY_INLINE V nearestInteger(V v) {
  const V shift = number(0x1.8p52);
  return hn::Sub(hn::Add(v, shift), shift);
}
HWY_INLINE V inSteps(V v, double largest) {
  return hn::Min(hn::Max(nearestInteger(v), number(-largest)), number(largest));
}
/// An integer's low bits in two's complement, from bit `shift` on.
HWY_INLINE V codeOf(V v, int bits, int shift) {
  const V low = hn::IfThenElse(hn::Lt(v, number(0)), hn::Add(v, number(1 << bits)), v);
  return hn::Mul(low, number(1 << shift));
}

/// The code that packGrowthCode() gives to the axis from[0..2] alone, which grows by `growth` steps.
HWY_INLINE V codeAlong(const V (&from)[3], V growth) {
  const V zero = number(0), one = number(1);
  // The frame's axis that is nearest.
  const V x = hn::Abs(from[0]), y = hn::Abs(from[1]), z = hn::Abs(from[2]);
  const auto beyond_x = hn::Gt(y, x);
  const V larger = hn::IfThenElse(beyond_x, y, x);
  const auto to_z = hn::Gt(z, larger), to_y = hn::AndNot(to_z, beyond_x);
  const V cosine = hn::IfThenElse(to_z, z, larger);
  const auto negative = hn::Lt(hn::IfThenElse(to_z, from[2], hn::IfThenElse(to_y, from[1], from[0])), zero);
  const V sign = hn::IfThenElse(negative, number(-1), one);

  // That axis times `from`, and the quaternion (1 + cosine, its components).
  const V fx = hn::Mul(sign, from[0]), fy = hn::Mul(sign, from[1]), fz = hn::Mul(sign, from[2]);
  const V qx = hn::IfThenElse(to_z, hn::Neg(fy), hn::IfThenElseZero(to_y, fz));
  const V qy = hn::IfThenElse(to_z, fx, hn::IfThenZeroElse(to_y, hn::Neg(fz)));
  const V qz = hn::IfThenZeroElse(to_z, hn::IfThenElse(to_y, hn::Neg(fx), fy));
  const V qw = hn::Add(one, cosine);
  const V length2 =
      hn::Add(hn::Add(hn::Mul(qw, qw), hn::Mul(qx, qx)), hn::Add(hn::Mul(qy, qy), hn::Mul(qz, qz)));
  const V inverse = hn::Div(one, hn::Sqrt(length2));

  const V along = codeOf(hn::Mul(sign, growth), kGrowthBits, 0);
  V code = hn::IfThenElse(to_z, hn::Mul(along, number(1 << 2 * kGrowthBits)),
                          hn::IfThenElse(to_y, hn::Mul(along, number(1 << kGrowthBits)), along));
  const V q[3] = {qx, qy, qz};
  for (int n = 0; n < 3; ++n) {
    const V steps = inSteps(hn::Div(hn::Mul(q[n], inverse), number(kRotationStep)), kLargestRotationCode);
    code = hn::Add(code, codeOf(steps, kRotationBits, kGrowthFrameShift + n * kRotationBits));
  }
  return code;
}

void findInnerGrowth(const InnerSplats& splats, const std::array<const float*, 3>& growth,
                     InnerGrowthCodes& out) {
  const Doubles d;
  const hn::Rebind<float, Doubles> singles;
  const hn::Rebind<int32_t, Doubles> integers;
  constexpr size_t kLanes = hn::MaxLanes(Doubles());
  for (size_t lane = 0; lane < kInnerNodesAtOnce; lane += kLanes) {
    V steps[3], from[3];
    for (size_t axis = 0; axis < 3; ++axis) {
      const V g = hn::PromoteTo(d, hn::LoadU(singles, growth[axis] + lane));
      steps[axis] = inSteps(hn::Mul(number(1 / kGrowthStep), g), kLargestGrowthCode);
    }
    const V zero = number(0);
    const auto along_i = hn::Ne(steps[0], zero), along_j = hn::Ne(steps[1], zero),
               along_k = hn::Ne(steps[2], zero);
    for (size_t n = 0; n < 3; ++n) {
      const auto load = [&](size_t axis) { return hn::Load(d, splats.rotated[axis][n] + lane); };
      from[n] = hn::IfThenElse(along_i, load(0), hn::IfThenElse(along_j, load(1), load(2)));
    }
    const V all = hn::Add(hn::Add(steps[0], steps[1]), steps[2]);  // one of them, unless several grow
    const auto several = hn::Or(hn::And(along_i, hn::Or(along_j, along_k)), hn::And(along_j, along_k));
    const auto any = hn::Or(hn::Or(along_i, along_j), along_k);
    const V code = hn::IfThenElseZero(any, codeAlong(from, all));
    const V known = hn::IfThenElse(several, number(kGrowsAlongSeveral), code);
    hn::Store(hn::DemoteTo(integers, known), integers, out.of + lane);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(findInnerGrowth);

void findInnerGrowth(const InnerSplats& splats, const std::array<const float*, 3>& growth,
                     InnerGrowthCodes& out) {
  HWY_DYNAMIC_DISPATCH(findInnerGrowth)(splats, growth, out);
}

}  // namespace curvisplat
#endif
