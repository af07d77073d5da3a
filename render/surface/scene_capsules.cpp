// The lines and points of a scene as capsules on the screen. Declared in scene_triangles.h.
#include <tbb/parallel_for.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "render/mesh/curve_set.h"
#include "render/surface/scene_triangles.h"

namespace curvisplat {
namespace {

constexpr float kStraightest = 0.15f;  // pixels
constexpr uint32_t kPointsAtOnce = 4096;
constexpr float kGuardRadii = 8;

/// The part of a capsule's axis in a square around the picture; NaN: none.
Capsule guarded(const Capsule& capsule, float guard) {
  const auto& [a, b] = capsule;
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  const Capsule none{{kNaN, kNaN, kNaN}, {kNaN, kNaN, kNaN}};
  float from = 0, to = 1;
  for (const auto axis : {&ScreenVertex::x, &ScreenVertex::y})
    for (const float sign : {-1.0f, 1.0f}) {
      const float of_a = guard - sign * a.*axis, of_b = guard - sign * b.*axis;  // inside: positive
      if (!(of_a >= 0 || of_b >= 0) || !std::isfinite(of_a) || !std::isfinite(of_b)) return none;
      if (of_a < 0) from = std::max(from, of_a / (of_a - of_b));
      if (of_b < 0) to = std::min(to, of_a / (of_a - of_b));
    }
  if (!(from <= to)) return none;
  const auto at = [a = a, b = b](float part) {
    return ScreenVertex{std::lerp(a.x, b.x, part), std::lerp(a.y, b.y, part),
                        std::lerp(a.value, b.value, part)};
  };
  return {at(from), at(to)};
}

/// Chooses the points of lines that a picture tells apart: a chord between two of them passes all points between
/// that are half a pixel or more from its beginning by no more than `straightest` pixels, and their values by
/// 1/256 of the range of all.
///
/// The first step from a point that was chosen gives a direction. Each point then leaves a disc of slopes beside it in which the
/// chord has to be, and an interval of what values may change along it; the chooser keeps a disc within all of them.
class PointChooser {
 public:
  PointChooser(const CurveSet& set, const ScreenView& view, const std::vector<ScreenVertex>& vertices,
               float straightest)
      : set_(set),
        vertices_(vertices),
        straightest_(straightest),
        focal_(static_cast<float>(view.focal_px)),
        perspective_(view.projection == Projection::kPerspective) {
    const auto [low, high] = set.range();
    evenest_ = kEvenest * (high - low);
  }

  void begin(uint32_t point) {
    chosen_ = before_ = point;
    way_ = {};
    has_direction_ = false;
  }
  /// Goes on to the next point of the line; returns whether the point before it has to be drawn.
  bool turnsBefore(uint32_t point) {
    const glm::vec3 way = wayTo(point);
    const float way2 = glm::dot(way, way);
    const float change = set_.values.empty() ? 0 : set_.values[point] - set_.values[chosen_];
    const bool turns = has_direction_ && !goesOnTo(way, change);
    if (turns) {
      begin(before_);
      turnsBefore(point);
    } else if (!has_direction_ && !(way2 < kNearest * kNearest)) {
      setDirection(way, std::sqrt(way2), change);
    }
    way_ = way2 <= 0 ? way_ : way;  // NaN: before the near plane
    before_ = point;
    return turns;
  }
  uint32_t chosen() const { return chosen_; }
  /// Whether the last point lies elsewhere than the chosen one.
  bool goesOn() const { return !(glm::dot(way_, way_) <= 0); }

 private:
  static constexpr float kNearest = 0.5f;        // pixels
  static constexpr float kEvenest = 1.0f / 256;  // of the range of values

  void setDirection(const glm::vec3& way, float length, float change) {
    has_direction_ = true;
    direction_ = way / length;
    along_ = length;
    slope_ = {};
    room_ = straightest_ / length;
    least_rise_ = (change - evenest_) / length;
    most_rise_ = (change + evenest_) / length;
  }
  /// Whether a chord to that point is straight and even; narrows what later ones may be.
  bool goesOnTo(const glm::vec3& way, float change) {
    const float along = glm::dot(way, direction_), per_along = 1 / along, rise = per_along * change;
    const glm::vec3 aside = per_along * way - direction_ - slope_;
    const float away2 = glm::dot(aside, aside);
    if (!(along >= along_ && away2 <= room_ * room_ && rise >= least_rise_ && rise <= most_rise_))
      return false;
    along_ = along;
    least_rise_ = std::max(least_rise_, rise - per_along * evenest_);
    most_rise_ = std::min(most_rise_, rise + per_along * evenest_);
    const float room = straightest_ * per_along, away = std::sqrt(away2);
    if (room_ >= room + away) {  // the new disc lies in the old one
      slope_ += aside;
      room_ = room;
    } else if (room < room_ + away) {  // both overlap
      slope_ += (0.5f * (room_ - room + away) / away) * aside;
      room_ = 0.5f * (room_ + room - away);
    }
    return true;
  }
  /// The way from the chosen point, in pixels; NaN if one lies before the near plane.
  glm::vec3 wayTo(uint32_t point) const {
    const ScreenVertex &a = vertices_[chosen_], &b = vertices_[point];
    const float deeper = b.value - a.value;
    return {b.x - a.x, b.y - a.y, focal_ * (perspective_ ? -deeper / b.value : deeper)};
  }

  const CurveSet& set_;
  const std::vector<ScreenVertex>& vertices_;
  const float straightest_, focal_;
  const bool perspective_;
  float evenest_ = 0;
  uint32_t chosen_ = 0, before_ = 0;
  glm::vec3 way_{}, direction_{};
  float along_ = 0;    // of the last point, which later ones do not fall behind
  glm::vec3 slope_{};  // of the disc's middle, a pixel along the direction
  float room_ = 0;     // its radius
  float least_rise_ = 0, most_rise_ = 0;
  bool has_direction_ = false;
};

}  // namespace

/// Blocks of points are looked at on their own: their last ones are drawn, too.
std::vector<uint32_t> SceneTriangles::capsuleBegins(size_t curve) const {
  const CurveSet& set = *curvesOf(curve).set;
  const auto points = static_cast<uint32_t>(set.positions.size());
  std::vector<uint32_t> begins(points, kNoCapsule);
  const PointChooser chooser_of_all(set, view_, vertices_[curve], kStraightest);
  const uint32_t blocks = (points + kPointsAtOnce - 1) / kPointsAtOnce;
  tbb::parallel_for(uint32_t{0}, blocks, [&](uint32_t block) {
    PointChooser chooser = chooser_of_all;
    const uint32_t first = block * kPointsAtOnce, end = std::min(points, first + kPointsAtOnce);
    auto line_end = std::upper_bound(set.begins.begin(), set.begins.end(), first);
    chooser.begin(first > *(line_end - 1) ? first - 1 : first);
    bool drawn = false;
    for (uint32_t n = first; n < end; ++n) {
      if (n == *(line_end - 1)) {
        chooser.begin(n);
        drawn = false;
      } else {
        const uint32_t chosen = chooser.chosen();
        if (chooser.turnsBefore(n)) {
          begins[chooser.chosen()] = chosen;
          drawn = true;
        }
      }
      const bool ends_line = n + 1 == *line_end;
      if ((ends_line || n + 1 == end) && chooser.chosen() != n && chooser.goesOn()) {
        begins[n] = chooser.chosen();
        drawn = true;
      }
      if (!ends_line) continue;
      if (!drawn) begins[n] = n;
      while (line_end != set.begins.end() && *line_end == n + 1) ++line_end;
      if (line_end == set.begins.end()) return;
    }
  });
  return begins;
}

Capsule SceneTriangles::cutCapsule(size_t curve, uint32_t point) const {
  const uint32_t from = beginOf(curve, point);
  Capsule capsule{vertices_[curve][from], vertices_[curve][point]};
  if (std::isnan(capsule.a.value + capsule.b.value)) {
    if (std::isnan(capsule.a.value) && std::isnan(capsule.b.value)) return capsule;
    const glm::dvec3 a = inView(curve, from), b = inView(curve, point);
    glm::dvec3 cut = a + (view_.near - a.z) / (b.z - a.z) * (b - a);
    cut.z = view_.near;
    (a.z < view_.near ? capsule.a : capsule.b) = project(cut);
  }
  const CapsuleLook& look = lookOf(curve);
  const float radius = std::max(look.radiusAt(capsule.a.value), look.radiusAt(capsule.b.value));
  return guarded(capsule, std::max(kGuard, kGuardRadii * radius));
}

std::pair<float, float> SceneTriangles::partsOf(size_t curve, uint32_t point, const Capsule& cut) const {
  const uint32_t from = beginOf(curve, point);
  const auto isSame = [](const ScreenVertex& a, const ScreenVertex& b) {
    return a.x == b.x && a.y == b.y && a.value == b.value;
  };
  if (isSame(cut.a, vertices_[curve][from]) && isSame(cut.b, vertices_[curve][point])) return {0.0f, 1.0f};
  const glm::dvec3 a = inView(curve, from), way = inView(curve, point) - a;
  const double length2 = glm::dot(way, way);
  if (!(length2 > 0)) return {0.0f, 1.0f};
  const bool perspective = view_.projection == Projection::kPerspective;
  const auto partAt = [&](const ScreenVertex& at) {
    const double z = perspective ? -1.0 / double{at.value} : double{at.value} + depth_origin_;
    const double per_pixel = (perspective ? z : 1.0) / view_.focal_px;
    const glm::dvec3 place((double{at.x} - 0.5 * view_.size.width) * per_pixel,
                           (double{at.y} - 0.5 * view_.size.height) * per_pixel, z);
    return static_cast<float>(std::clamp(glm::dot(place - a, way) / length2, 0.0, 1.0));
  };
  return {partAt(cut.a), partAt(cut.b)};
}

CapsuleLook SceneTriangles::makeLook(const Curves& curves) const {
  const double radius = 0.5 * curves.width * (curves.in_pixels ? 1 : view_.focal_px);
  return {view_.projection == Projection::kPerspective,
          static_cast<float>(view_.focal_px),
          static_cast<float>(0.5 * view_.size.width),
          static_cast<float>(0.5 * view_.size.height),
          static_cast<float>(-1 / view_.near),
          static_cast<float>(radius),
          curves.in_pixels};
}

}  // namespace curvisplat
