#include "render/surface/iso_field.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "render/project/footprint.h"

// The code from here to HWY_AFTER_NAMESPACE is compiled once for every instruction set that a processor may
// have.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/surface/iso_field.cpp"
#include <hwy/foreach_target.h>  // before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace curvisplat {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kIsoRays>;
using Vector = hn::Vec<Floats>;

constexpr auto kSupport = static_cast<float>(kKernelSupport);

HWY_INLINE Vector weightOf(const IsoCrossed& s, size_t ray, Vector t) {
  const Floats d;
  const Vector inside =
      hn::NegMulAdd(hn::Mul(hn::Load(d, s.by.data() + ray), t), t, hn::Load(d, s.from.data() + ray));
  const Vector x = hn::Max(inside, hn::Zero(d));
  Vector k = hn::Set(d, kIsoKernel[4]);
  for (int n = 3; n >= 0; --n) k = hn::MulAdd(k, x, hn::Set(d, kIsoKernel[n]));
  return hn::Mul(hn::Mul(hn::Mul(hn::Set(d, s.weight), x), x), k);
}

void sumField(std::span<const IsoCrossed* const> splats, const IsoRow& z, IsoField& field) {
  const Floats d;
  for (size_t ray = 0; ray < kIsoRays; ray += hn::Lanes(d)) {
    const Vector at = hn::LoadU(d, z.data() + ray);
    Vector weight = hn::Zero(d), sum = hn::Zero(d);
    for (const IsoCrossed* const splat : splats) {
      const IsoCrossed& s = *splat;
      const Vector t = hn::Sub(at, hn::Load(d, s.middle.data() + ray));
      const Vector w = weightOf(s, ray, t);
      weight = hn::Add(weight, w);
      const Vector f = hn::MulAdd(hn::Load(d, s.change.data() + ray), t, hn::Load(d, s.mean.data() + ray));
      sum = hn::MulAdd(w, f, sum);
    }
    hn::StoreU(weight, d, field.weight.data() + ray);
    hn::StoreU(hn::Div(sum, hn::Max(weight, hn::Set(d, 1e-20f))), d, field.value.data() + ray);
  }
}

template <class Mask>
HWY_INLINE unsigned bitsOf(Mask mask) {
  uint8_t bits[8] = {};
  hn::StoreMaskBits(Floats(), mask, bits);
  return bits[0] | static_cast<unsigned>(bits[1]) << 8;
}

HWY_INLINE auto hasField(const IsoField& field, size_t ray, float least) {
  const Floats d;
  return hn::Gt(hn::LoadU(d, field.weight.data() + ray), hn::Set(d, least));
}

unsigned crossedRays(const IsoField& begin, const IsoField& end, float value, float least) {
  const Floats d;
  const auto isBelow = [&](const IsoField& field, size_t ray) {
    return hn::Lt(hn::LoadU(d, field.value.data() + ray), hn::Set(d, value));
  };
  unsigned bits = 0;
  for (size_t ray = 0; ray < kIsoRays; ray += hn::Lanes(d))
    bits |= bitsOf(hn::And(hn::Xor(isBelow(begin, ray), isBelow(end, ray)),
                           hn::And(hasField(begin, ray, least), hasField(end, ray, least))))
            << ray;
  return bits;
}

unsigned turnedRays(const std::array<const IsoField*, 3>& fields, float value, float least) {
  const Floats d;
  const Vector wanted = hn::Set(d, value);
  unsigned bits = 0;
  for (size_t ray = 0; ray < kIsoRays; ray += hn::Lanes(d)) {
    const auto at = [&](size_t n) { return hn::Sub(hn::LoadU(d, fields[n]->value.data() + ray), wanted); };
    const Vector middle = at(1);
    const auto isFarther = [&](Vector other) {
      const auto turned = hn::Xor(hn::And(hn::SignBit(d), middle), other);  // above 0: on its side
      return hn::Ge(turned, hn::Abs(middle));
    };
    auto mask = hn::And(isFarther(at(0)), isFarther(at(2)));
    for (const IsoField* field : fields) mask = hn::And(mask, hasField(*field, ray, least));
    bits |= bitsOf(mask) << ray;
  }
  return bits;
}

void sumSlopes(std::span<const IsoCrossed* const> splats, const IsoRow& z, IsoSlopes& slopes) {
  const Floats d;
  for (size_t ray = 0; ray < kIsoRays; ray += hn::Lanes(d)) {
    const Vector at = hn::LoadU(d, z.data() + ray);
    Vector weight = hn::Zero(d), x = hn::Zero(d), y = hn::Zero(d), along = hn::Zero(d);
    for (const IsoCrossed* const splat : splats) {
      const IsoCrossed& s = *splat;
      const Vector w = weightOf(s, ray, hn::Sub(at, hn::Load(d, s.middle.data() + ray)));
      weight = hn::Add(weight, w);
      x = hn::MulAdd(w, hn::Set(d, s.gradient.x), x);
      y = hn::MulAdd(w, hn::Set(d, s.gradient.y), y);
      along = hn::MulAdd(w, hn::Set(d, s.gradient.z), along);
    }
    const Vector part = hn::Div(hn::Set(d, 1.0f), hn::Max(weight, hn::Set(d, 1e-20f)));
    hn::StoreU(weight, d, slopes.weight.data() + ray);
    hn::StoreU(hn::Mul(x, part), d, slopes.x.data() + ray);
    hn::StoreU(hn::Mul(y, part), d, slopes.y.data() + ray);
    hn::StoreU(hn::Mul(along, part), d, slopes.z.data() + ray);
  }
}

bool crossSplat(const IsoSplats::Placed& placed, const IsoFan& fan, IsoCrossed& out) {
  const Floats d;
  const IsoSplat& splat = *placed.splat;
  const glm::vec3 r = splat.by_right, down = splat.by_down, f = splat.by_forward;
  const glm::dvec3 centre = splat.centre;
  const double distance = fan.perspective ? centre.z : 1;
  const auto first_x = static_cast<float>(fan.corner.x * distance - centre.x);
  const auto first_y = static_cast<float>(fan.corner.y * distance - centre.y);
  const float leans = fan.perspective ? 1.0f : 0.0f;  // a ray from the middle of the view
  const glm::vec3 g(glm::dot(splat.slope, r), glm::dot(splat.slope, down), glm::dot(splat.slope, f));
  const auto from_base = static_cast<float>(centre.z - fan.base_depth);
  constexpr float kPerSupport2 = 1 / (kSupport * kSupport);
  const auto set = [&](float value) { return hn::Set(d, value); };
  Vector shortest = set(0), longest = set(INFINITY), most = set(-INFINITY), begin = set(INFINITY),
         end = set(-INFINITY);
  for (size_t ray = 0; ray < kIsoRays; ray += hn::Lanes(d)) {
    // At the centre's depth the ray is at `base` in the frame of A, and it moves by `along`.
    const Vector off_x = hn::LoadU(d, fan.x.data() + ray), off_y = hn::LoadU(d, fan.y.data() + ray);
    const Vector x = hn::MulAdd(off_x, set(static_cast<float>(distance)), set(first_x));
    const Vector y = hn::MulAdd(off_y, set(static_cast<float>(distance)), set(first_y));
    const Vector lean_x = hn::Mul(set(leans), hn::Add(off_x, set(static_cast<float>(fan.corner.x))));
    const Vector lean_y = hn::Mul(set(leans), hn::Add(off_y, set(static_cast<float>(fan.corner.y))));
    const auto base = [&](int axis) { return hn::MulAdd(x, set(r[axis]), hn::Mul(y, set(down[axis]))); };
    const auto along = [&](int axis) {
      return hn::MulAdd(lean_x, set(r[axis]), hn::MulAdd(lean_y, set(down[axis]), set(f[axis])));
    };
    const Vector b0 = base(0), b1 = base(1), b2 = base(2), a0 = along(0), a1 = along(1), a2 = along(2);
    const auto dot = [](Vector u0, Vector u1, Vector u2, Vector v0, Vector v1, Vector v2) {
      return hn::MulAdd(u2, v2, hn::MulAdd(u1, v1, hn::Mul(u0, v0)));
    };
    const auto cross = [](Vector u1, Vector u2, Vector v1, Vector v2) {
      return hn::Sub(hn::Mul(u1, v2), hn::Mul(u2, v1));
    };
    const Vector c0 = cross(b1, b2, a1, a2), c1 = cross(b2, b0, a2, a0), c2 = cross(b0, b1, a0, a1);
    const Vector length2 = dot(a0, a1, a2, a0, a1, a2);
    const Vector per_length2 = hn::Div(set(1), length2);
    const Vector nearest = hn::Neg(hn::Mul(dot(b0, b1, b2, a0, a1, a2), per_length2));
    const Vector change = hn::MulAdd(lean_x, set(g.x), hn::MulAdd(lean_y, set(g.y), set(g.z)));
    const Vector by = hn::Mul(length2, set(kPerSupport2));
    const Vector from =
        hn::NegMulAdd(hn::Mul(dot(c0, c1, c2, c0, c1, c2), per_length2), set(kPerSupport2), set(1));
    const Vector at_base = hn::MulAdd(x, set(g.x), hn::MulAdd(y, set(g.y), set(splat.mean)));
    hn::Store(hn::Add(set(from_base), nearest), d, out.middle.data() + ray);
    hn::Store(from, d, out.from.data() + ray);
    hn::Store(by, d, out.by.data() + ray);
    hn::Store(hn::MulAdd(nearest, change, at_base), d, out.mean.data() + ray);
    hn::Store(change, d, out.change.data() + ray);
    shortest = hn::Max(shortest, by);
    longest = hn::Min(longest, by);
    most = hn::Max(most, from);
    begin = hn::Min(begin, nearest);
    end = hn::Max(end, nearest);
  }
  const auto least = [&](Vector v) { return hn::GetLane(hn::MinOfLanes(d, v)); };
  const auto greatest = [&](Vector v) { return hn::GetLane(hn::MaxOfLanes(d, v)); };
  const float most_inside = greatest(most);
  if (!(most_inside > 0)) return false;
  const float half = std::sqrt(most_inside / least(longest));
  out.begin = from_base + least(begin) - half;
  out.end = from_base + greatest(end) + half;
  out.step = kIsoStep / std::sqrt(greatest(shortest));
  out.gradient = g;
  out.weight = splat.weight;
  out.splat = &placed;
  return out.begin < out.end && std::isfinite(out.end - out.begin) && out.step > 0;
}

}  // namespace HWY_NAMESPACE
}  // namespace curvisplat
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace curvisplat {

HWY_EXPORT(sumField);
HWY_EXPORT(crossedRays);
HWY_EXPORT(turnedRays);
HWY_EXPORT(sumSlopes);
HWY_EXPORT(crossSplat);

void sumField(std::span<const IsoCrossed* const> splats, const IsoRow& z, IsoField& field) {
  HWY_DYNAMIC_DISPATCH(sumField)(splats, z, field);
}

unsigned crossedRays(const IsoField& begin, const IsoField& end, float value, float least) {
  return HWY_DYNAMIC_DISPATCH(crossedRays)(begin, end, value, least);
}

unsigned turnedRays(const std::array<const IsoField*, 3>& fields, float value, float least) {
  return HWY_DYNAMIC_DISPATCH(turnedRays)(fields, value, least);
}

void sumSlopes(std::span<const IsoCrossed* const> splats, const IsoRow& z, IsoSlopes& slopes) {
  HWY_DYNAMIC_DISPATCH(sumSlopes)(splats, z, slopes);
}

bool crossSplat(const IsoSplats::Placed& placed, const IsoFan& fan, IsoCrossed& out) {
  return HWY_DYNAMIC_DISPATCH(crossSplat)(placed, fan, out);
}

float isoWeight(const IsoCrossed& splat, size_t ray, float z) {
  const float t = z - splat.middle[ray];
  const float x = std::max(splat.from[ray] - splat.by[ray] * t * t, 0.0f);
  float k = 0;
  for (int n = 4; n >= 0; --n) k = k * x + kIsoKernel[n];
  return splat.weight * x * x * k;
}

}  // namespace curvisplat
#endif
