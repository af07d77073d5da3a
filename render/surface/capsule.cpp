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

/// The way from one end to the other, in pixels at the first.
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

CapsulePlace placeOn(const Capsule& capsule, const CapsuleLook& look, float x, float y) {
  const auto& [a, b] = capsule;
  const float ratio = look.perspective ? a.value / b.value : 1;
  const glm::vec3 w = look.perspective
                          ? glm::vec3((x - look.middle_x) / look.focal, (y - look.middle_y) / look.focal, 1)
                          : glm::vec3(0, 0, 1);
  const glm::vec3 e = wayOf(capsule, look);
  const float radius_a = look.radiusAt(a.value), radius_b = look.in_pixels ? radius_a * ratio : radius_a;
  const glm::vec3 q(x - a.x, y - a.y, 0);
  const float length = glm::length(e);
  const bool has_length = length > CapsuleLook::kNoLength;
  const glm::vec3 u = has_length ? e / length : glm::vec3(1, 0, 0);
  const float end = has_length ? length : 0;
  const glm::vec3 across = glm::cross(w, u);
  const float sine2 = std::max(glm::dot(across, across), CapsuleLook::kMinSine2);
  const float wu = glm::dot(w, u), qu = glm::dot(q, u), wq = glm::dot(w, q), aside = glm::dot(q, across);
  const float t0 = (wu * qu - wq) / sine2, along0 = qu + t0 * wu;
  const float radius =
      has_length ? radius_a + (radius_b - radius_a) / end * std::clamp(along0, 0.0f, end) : radius_a;
  const float root = std::sqrt(std::max(radius * radius * sine2 - aside * aside, 0.0f)) / sine2;
  const float along = along0 - root * wu;
  CapsulePlace place{};
  const bool of_a = along < 0 && !look.isCutAt(a), of_b = along > end && !look.isCutAt(b);
  if (!of_a && !of_b && has_length) {
    place.normal = q + (t0 - root) * w - along * u;
    place.along = along / end;
  } else {
    const glm::vec3 from = of_b ? ratio * glm::vec3(x - b.x, y - b.y, 0) : q;
    const float ww = glm::dot(w, w), turned = w.x * from.y - w.y * from.x;
    const float of_end = of_b ? radius_b : radius_a;
    const float left = ww * of_end * of_end - (from.x * from.x + from.y * from.y + turned * turned);
    const float t = -(w.x * from.x + w.y * from.y + std::sqrt(std::max(left, 0.0f))) / ww;
    place.normal = from + t * w;
    place.along = of_b ? 1 : 0;
  }
  const float size = glm::length(place.normal);
  place.normal = size > 0 ? place.normal / size : -w;
  return place;
}

glm::vec3 axisOf(const Capsule& capsule, const CapsuleLook& look) {
  const glm::vec3 way = wayOf(capsule, look);
  const float length = glm::length(way);
  return length > CapsuleLook::kNoLength ? way / length : glm::vec3(0.0f);
}

}  // namespace curvisplat
