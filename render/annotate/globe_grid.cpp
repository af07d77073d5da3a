#include <cairo/cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/annotate/annotated_scene.h"
#include "render/annotate/axes_grid.h"
#include "render/annotate/canvas.h"

namespace curvisplat {
namespace {

constexpr int kPieces = 48;         // of a bent line
constexpr double kHalfEarth = 120;  // degrees of longitude: wider data hides what lies behind the Earth
constexpr double kAround = 359.9;
constexpr double kNearPole = 89;

/// Multiples of a step of degrees within a range, at most `most` but no fewer than two where the range has them.
std::vector<double> degreeTicks(double low, double high, int most, double& step) {
  constexpr double kSteps[] = {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5,
                               1,     2,     5,     10,   15,   30,   45,  60,  90};
  step = kSteps[0];
  for (const double one : kSteps) {
    step = one;
    if ((high - low) / one < most) break;
  }
  std::vector<double> ticks;
  for (double n = std::ceil(low / step - 1e-6); n * step <= high + 1e-6 * step; ++n)
    ticks.push_back(n * step);
  return ticks;
}

std::string degreeLabel(double degrees, double step, int axis) {
  const int decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  const double there = axis == 0 ? std::remainder(degrees, 360) : degrees;
  const double size = std::abs(there);
  const bool has_side = size > 1e-9 && !(axis == 0 && size > 180 - 1e-9);
  return fmt::format("{:.{}f}°{}", size, decimals,
                     !has_side   ? ""
                     : axis == 0 ? (there > 0 ? "E" : "W")
                     : there > 0 ? "N"
                                 : "S");
}

/// The box, whose places are longitude, latitude and height.
class GlobeBox {
 public:
  explicit GlobeBox(const AnnotatedScene& scene)
      : scene_(scene),
        box_(*scene.on_globe),
        around_(box_.globe.sphere() && box_.upper.x - box_.lower.x > kAround) {
    const double font = fontSize(scene.view.size, scene.text_size);
    for (int axis = 0; axis < 3; ++axis) {
      double longest = 0;
      for (int n = 0; n < 4; ++n) longest = std::max(longest, lengthOf(edge(axis, n & 1, n & 2)));
      setTicks(axis, around_ ? kMaxTicks : ticksAlong(longest, font));
    }
  }

  bool around() const { return around_; }
  const AnnotatedScene::OnGlobe& box() const { return box_; }
  const std::vector<AxisTick>& ticks(int axis) const { return ticks_[axis]; }

  struct Edge {
    glm::dvec3 from, to;
  };
  Edge edge(int axis, bool upper_b, bool upper_c) const {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    Edge e{box_.lower, box_.lower};
    e.from[b] = e.to[b] = upper_b ? box_.upper[b] : box_.lower[b];
    e.from[c] = e.to[c] = upper_c ? box_.upper[c] : box_.lower[c];
    e.to[axis] = box_.upper[axis];
    return e;
  }

  glm::dvec3 inView(const glm::dvec3& place) const {
    return scene_.view.viewFromData(box_.globe.placeAt(place));
  }
  std::optional<glm::dvec2> pixelOf(const glm::dvec3& place) const {
    const glm::dvec3 at = inView(place);
    const auto line = lineInImage(scene_.view, at, at);
    return line ? std::optional(line->first) : std::nullopt;
  }

  /// Whether a side is there: not where the data goes all around, and not at a pole.
  bool has(int axis, bool upper) const {
    if (axis == 0) return !around_;
    return axis == 2 || std::abs(upper ? box_.upper.y : box_.lower.y) < kNearPole;
  }
  /// Whether a place of the side is seen from outside (1), from inside (-1), or edge-on or behind the Earth (0).
  int seen(const glm::dvec3& place, int axis, bool upper) const {
    if (!has(axis, upper) || isHidden(place)) return 0;
    const glm::dvec3 at = inView(place);
    std::array<glm::dvec3, 3> steps{};
    for (int n = 0; n < 3; ++n) {
      glm::dvec3 moved = place;
      moved[n] += 1e-3 * std::max(box_.upper[n] - box_.lower[n], 1e-6);
      steps[n] = inView(moved) - at;
    }
    glm::dvec3 outward = glm::cross(steps[(axis + 1) % 3], steps[(axis + 2) % 3]);
    if ((glm::dot(outward, steps[axis]) > 0) != upper) outward = -outward;
    const glm::dvec3 ray = scene_.view.projection == Projection::kPerspective ? at : glm::dvec3(0, 0, 1);
    const double away = glm::dot(outward, ray);
    constexpr double kEdgeOn = 0.02;
    if (!(std::abs(away) > kEdgeOn * glm::length(outward) * glm::length(ray))) return 0;
    return away < 0 ? 1 : -1;
  }

  /// Adds the pieces of a line, straight in longitude, latitude and height, for which `use(middle)` holds.
  template <typename Use>
  void addLine(cairo_t* cairo, const glm::dvec3& from, const glm::dvec3& to, const Use& use) const {
    const int pieces = from.x == to.x && from.y == to.y ? 1 : kPieces;
    for (int n = 0; n < pieces; ++n) {
      const glm::dvec3 a = glm::mix(from, to, double(n) / pieces),
                       b = glm::mix(from, to, double(n + 1) / pieces);
      if (!use(0.5 * (a + b))) continue;
      const auto line = lineInImage(scene_.view, inView(a), inView(b));
      if (!line) continue;
      cairo_move_to(cairo, line->first.x, line->first.y);
      cairo_line_to(cairo, line->second.x, line->second.y);
    }
  }

  /// The edge along an axis that has its coordinates: one of the outline, below or at the left if possible.
  std::optional<Edge> labelled(int axis) const {
    std::optional<Edge> best;
    double best_score = 0;
    for (int n = 0; n < 4; ++n) {
      const bool of_b = n & 1, of_c = n & 2;
      const Edge e = edge(axis, of_b, of_c);
      const glm::dvec3 place = 0.5 * (e.from + e.to);
      if ((seen(place, (axis + 1) % 3, of_b) > 0) == (seen(place, (axis + 2) % 3, of_c) > 0)) continue;
      const auto from = pixelOf(e.from), to = pixelOf(e.to);
      if (!from || !to) continue;
      const glm::dvec2 along = glm::abs(*to - *from), middle = 0.5 * (*from + *to);
      const double score = middle.y * along.x - middle.x * along.y;
      if (best && score <= best_score) continue;
      best = e;
      best_score = score;
    }
    return best;
  }

  /// Longitude and latitude below the viewer.
  glm::dvec2 belowViewer() const {
    const ScreenView& view = scene_.view;
    const glm::dvec3 towards = view.projection == Projection::kPerspective ? view.eye : -view.forward;
    return glm::dvec2(box_.globe.geographic(towards / view.scale));
  }

 private:
  double lengthOf(const Edge& e) const {
    const auto from = pixelOf(e.from), to = pixelOf(e.to);
    return from && to ? glm::distance(*from, *to) : 0;
  }

  void setTicks(int axis, int wanted) {
    const double low = box_.lower[axis], high = box_.upper[axis];
    if (!(std::isfinite(low) && std::isfinite(high) && low < high)) return;
    if (axis < 2) {
      double step = 1;
      const double end = around_ && axis == 0 ? high - 1e-3 : high;  // 180° W is 180° E
      for (const double degrees : degreeTicks(low, end, around_ && axis == 0 ? 12 : wanted, step))
        ticks_[axis].push_back({degrees, degreeLabel(degrees, step, axis)});
      return;
    }
    // Depths increase downwards.
    const double metres = box_.isOfDepths() ? -1000 : 1000;
    for (AxisTick tick : axisTicks(
             {{std::min(metres * low, metres * high), std::max(metres * low, metres * high)}}, wanted)) {
      tick.value /= metres;
      ticks_[axis].push_back(std::move(tick));
    }
  }

  /// Whether the Earth below the data hides a place.
  bool isHidden(const glm::dvec3& place) const {
    if (!box_.globe.sphere() || box_.upper.x - box_.lower.x < kHalfEarth) return false;
    const ScreenView& view = scene_.view;
    const glm::dvec3 at = box_.globe.placeAt(place), eye = view.eye / view.scale;
    const glm::dvec3 towards =
        view.projection == Projection::kPerspective ? eye - at : -view.forward / view.scale;
    // The ray from the place to the viewer meets the sphere where |at + t towards| = radius, t > 0.
    const double radius = 0.999 * (box_.globe.radius_km + box_.globe.vertical_scale * box_.lower.z);
    const double a = glm::dot(towards, towards), b = glm::dot(at, towards),
                 c = glm::dot(at, at) - radius * radius;
    return b < 0 && b * b > a * c;
  }

  const AnnotatedScene& scene_;
  const AnnotatedScene::OnGlobe& box_;
  const bool around_;
  std::array<std::vector<AxisTick>, 3> ticks_;
};

}  // namespace

void drawGlobeGrid(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  const GlobeBox box(scene);
  cairo_set_line_width(cairo, std::max(1.0, fontSize(scene.view.size, scene.text_size) / 14));
  for (int axis = 0; axis < 3; ++axis)
    for (const bool upper : {false, true}) {
      if (!box.has(axis, upper)) continue;
      const auto is_behind = [&](const glm::dvec3& place) { return box.seen(place, axis, upper) < 0; };
      const double at = upper ? box.box().upper[axis] : box.box().lower[axis];
      for (const bool edges : {false, true}) {
        for (const int along : {(axis + 1) % 3, (axis + 2) % 3}) {
          const int across = 3 - axis - along;
          glm::dvec3 from = box.box().lower, to = box.box().upper;
          from[axis] = to[axis] = at;
          if (edges) {
            for (const bool end : {false, true}) {
              if (!box.has(across, end)) continue;
              from[across] = to[across] = end ? box.box().upper[across] : box.box().lower[across];
              box.addLine(cairo, from, to, is_behind);
            }
            continue;
          }
          for (const AxisTick& tick : box.ticks(across)) {
            from[across] = to[across] = tick.value;
            box.addLine(cairo, from, to, is_behind);
          }
        }
        setInk(cairo, ink, edges ? 0.5 : 0.2);
        cairo_stroke(cairo);
      }
    }
}

namespace {

/// Coordinates on the Earth's side that is seen: of meridians at one latitude, of circles of latitude at one longitude.
void drawLabelsOnEarth(cairo_t* cairo, const AnnotatedScene& scene, const GlobeBox& box,
                       const glm::dvec3& ink) {
  const double font = fontSize(scene.view.size, scene.text_size);
  const glm::dvec2 below = box.belowViewer();
  for (const int axis : {0, 1}) {
    const int other = 1 - axis;
    const auto& lines = box.ticks(other);
    if (lines.empty()) continue;
    const auto away = [&](const AxisTick& tick) {
      return std::abs(other == 0 ? std::remainder(tick.value - below.x, 360) : tick.value - below.y);
    };
    // Those of latitudes stand between two meridians, not on the longitude of one.
    const double aside = axis == 1 && lines.size() > 1 ? 0.5 * (lines[1].value - lines[0].value) : 0;
    const double at =
        aside + std::min_element(lines.begin(), lines.end(), [&](const AxisTick& a, const AxisTick& b) {
                  return away(a) < away(b);
                })->value;
    for (const AxisTick& tick : box.ticks(axis)) {
      glm::dvec3 place(0, 0, box.box().upper.z);
      place[axis] = tick.value;
      place[other] = at;
      if (std::abs(place.y) > kNearPole || box.seen(place, 2, true) <= 0) continue;
      const auto pixel = box.pixelOf(place);
      if (pixel) drawOverData(cairo, *pixel + glm::dvec2(0.2, -0.2) * font, tick.label, font, ink);
    }
  }
}

}  // namespace

void drawGlobeLabels(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  const GlobeBox box(scene);
  setInk(cairo, ink);
  if (box.around()) return drawLabelsOnEarth(cairo, scene, box, ink);
  const auto centre = box.pixelOf(0.5 * (box.box().lower + box.box().upper));
  if (!centre) return;
  // Coordinates of an edge that the picture does not show would crowd at the picture's own edge.
  const auto isInside = [&](const glm::dvec2& at) {
    return at.x >= 0 && at.y >= 0 && at.x <= scene.view.size.width && at.y <= scene.view.size.height;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const auto edge = box.labelled(axis);
    if (!edge) continue;
    const auto from = box.pixelOf(edge->from), to = box.pixelOf(edge->to),
               middle = box.pixelOf(0.5 * (edge->from + edge->to));
    if (!from || !to || !middle) continue;
    // Depths are small beside the Earth.
    LabelledEdge labelled{
        *from, *middle, *to, {}, scene.axis_titles[static_cast<size_t>(axis)], axis == 2 ? 1.5 : 3.0};
    for (const AxisTick& tick : box.ticks(axis)) {
      glm::dvec3 at = edge->from;
      at[axis] = tick.value;
      const auto point = box.pixelOf(at);
      if (point && isInside(*point)) labelled.ticks.emplace_back(*point, tick.label);
    }
    if (!isInside(*middle)) labelled.title.clear();
    drawEdgeLabels(cairo, scene, labelled, *centre);
    box.addLine(cairo, edge->from, edge->to, [](const glm::dvec3&) { return true; });
    cairo_stroke(cairo);
  }
}

}  // namespace curvisplat
