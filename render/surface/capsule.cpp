#include "render/surface/capsule.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace curvisplat {
namespace {

/// How far a ball reaches on the screen from its middle, at most.
float reachOf(const ScreenVertex& middle, const CapsuleLook& look) {
  const float radius = look.radiusAt(middle.value);
  if (!look.perspective) return radius;
  const float part = radius / look.focal;  // of the distance along the view
  if (!(part < CapsuleLook::kNearPart) || look.isCutAt(middle)) return CapsuleLook::kEverywhere;
  const float x = (middle.x - look.middle_x) / look.focal, y = (middle.y - look.middle_y) / look.focal;
  const float out2 = x * x + y * y, out = std::sqrt(out2);
  // The tangent of the angle to the farther side of the ball.
  const float far = (out + part * std::sqrt(1 + out2 - part * part)) / (1 - part * part);
  return look.focal * (far - out);
}

/// The way from one end to the other, in pixels at the first, as CapsuleSpots has it.
glm::vec3 wayOf(const Capsule& capsule, const CapsuleLook& look) {
  const auto& [a, b] = capsule;
  if (!look.perspective) return {b.x - a.x, b.y - a.y, look.focal * (b.value - a.value)};
  const float ratio = a.value / b.value, more = (a.value - b.value) / b.value;
  return {ratio * (b.x - a.x) + more * (a.x - look.middle_x),
          ratio * (b.y - a.y) + more * (a.y - look.middle_y), look.focal * more};
}

}  // namespace

CapsuleBox boxOf(const Capsule& capsule, const CapsuleLook& look) {
  const auto& [a, b] = capsule;
  const float of_a = reachOf(a, look), of_b = reachOf(b, look);
  return {std::min(a.x - of_a, b.x - of_b), std::min(a.y - of_a, b.y - of_b),
          std::max(a.x + of_a, b.x + of_b), std::max(a.y + of_a, b.y + of_b)};
}

void CapsuleSpots::add(const Capsule& capsule, const CapsuleLook& look, float x, float y) {
  const size_t n = count_++;
  x_[n] = x;
  y_[n] = y;
  ax_[n] = capsule.a.x;
  ay_[n] = capsule.a.y;
  a_value_[n] = capsule.a.value;
  bx_[n] = capsule.b.x;
  by_[n] = capsule.b.y;
  b_value_[n] = capsule.b.value;
  a_is_cut_[n] = look.isCutAt(capsule.a) ? 1.0f : 0.0f;
  b_is_cut_[n] = look.isCutAt(capsule.b) ? 1.0f : 0.0f;
  radius_[n] = look.radiusAt(capsule.a.value);
  widens_[n] = look.in_pixels ? 1.0f : 0.0f;
}

/// Chooses between the tube and the balls at its ends without a branch, so that compilers make vectors of the loop.
template <bool kPerspective>
void CapsuleSpots::findPlacesIn(const CapsuleLook& look) {
  const float focal = look.focal, middle_x = look.middle_x, middle_y = look.middle_y;
  CapsuleSpots& s = *this;
  const size_t count = count_;
  for (size_t n = 0; n < count; ++n) {
    const float x = s.x_[n], y = s.y_[n], qx = x - s.ax_[n], qy = y - s.ay_[n];
    float ratio = 1, wx = 0, wy = 0, ex = s.bx_[n] - s.ax_[n], ey = s.by_[n] - s.ay_[n],
          ez = focal * (s.b_value_[n] - s.a_value_[n]);
    if constexpr (kPerspective) {
      const float per_b = 1 / s.b_value_[n], more = (s.a_value_[n] - s.b_value_[n]) * per_b;
      ratio = s.a_value_[n] * per_b;
      wx = (x - middle_x) / focal;
      wy = (y - middle_y) / focal;
      ex = ratio * ex + more * (s.ax_[n] - middle_x);
      ey = ratio * ey + more * (s.ay_[n] - middle_y);
      ez = focal * more;
    }
    const float radius_a = s.radius_[n], radius_b = s.widens_[n] != 0 ? radius_a * ratio : radius_a;
    const float length = std::sqrt(ex * ex + ey * ey + ez * ez);
    const bool has_length = length > CapsuleLook::kNoLength;
    const float per_length = 1 / length, end = has_length ? length : 0.0f;
    const float ux = has_length ? ex * per_length : 1.0f, uy = has_length ? ey * per_length : 0.0f,
                uz = has_length ? ez * per_length : 0.0f;
    const float cx = wy * uz - uy, cy = ux - uz * wx, cz = wx * uy - ux * wy;
    const float cross2 = cx * cx + cy * cy + cz * cz;
    const float sine2 = cross2 > CapsuleLook::kMinSine2 ? cross2 : CapsuleLook::kMinSine2;
    const float per_sine2 = 1 / sine2;
    const float wu = wx * ux + wy * uy + uz, qu = qx * ux + qy * uy, wq = wx * qx + wy * qy,
                aside = qx * cx + qy * cy;
    const float t0 = (wu * qu - wq) * per_sine2, along0 = qu + t0 * wu;
    const float before_end = along0 < end ? along0 : end, clamped = before_end > 0 ? before_end : 0.0f;
    const float growth = has_length ? (radius_b - radius_a) * per_length : 0.0f;
    const float radius = radius_a + growth * clamped, left2 = radius * radius * sine2 - aside * aside;
    const float root = std::sqrt(left2 > 0 ? left2 : 0.0f) * per_sine2, along = along0 - root * wu;
    const bool of_a = (along < 0) & (s.a_is_cut_[n] == 0), of_b = (along > end) & (s.b_is_cut_[n] == 0);
    // The ball at one of its ends.
    const float fx = of_b ? ratio * (x - s.bx_[n]) : qx, fy = of_b ? ratio * (y - s.by_[n]) : qy;
    const float ww = wx * wx + wy * wy + 1, turned = wx * fy - wy * fx, of_end = of_b ? radius_b : radius_a;
    const float ball2 = ww * of_end * of_end - (fx * fx + fy * fy + turned * turned);
    const float t = -(wx * fx + wy * fy + std::sqrt(ball2 > 0 ? ball2 : 0.0f)) / ww;
    const bool of_tube = has_length & !of_a & !of_b;
    const float from_x = of_tube ? qx - along * ux : fx, from_y = of_tube ? qy - along * uy : fy,
                from_z = of_tube ? -along * uz : 0.0f, step = of_tube ? t0 - root : t;
    const float nx = from_x + step * wx, ny = from_y + step * wy, nz = from_z + step;
    const float size = std::sqrt(nx * nx + ny * ny + nz * nz), per_size = 1 / size;
    s.normal_x_[n] = size > 0 ? nx * per_size : -wx;
    s.normal_y_[n] = size > 0 ? ny * per_size : -wy;
    s.normal_z_[n] = size > 0 ? nz * per_size : -1.0f;
    s.along_[n] = of_tube ? along * per_length : (of_b ? 1.0f : 0.0f);
  }
}

template void CapsuleSpots::findPlacesIn<true>(const CapsuleLook&);
template void CapsuleSpots::findPlacesIn<false>(const CapsuleLook&);

glm::vec3 axisOf(const Capsule& capsule, const CapsuleLook& look) {
  const glm::vec3 way = wayOf(capsule, look);
  const float length = glm::length(way);
  return length > CapsuleLook::kNoLength ? way / length : glm::vec3(0.0f);
}

}  // namespace curvisplat
