#include "render/annotate/axes_grid.h"

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
#include "render/annotate/canvas.h"

namespace curvisplat {
namespace {

// A side that is seen at a lower angle than this is seen edge-on: its sine.
constexpr double kEdgeOn = 0.02;
constexpr double kTick = 0.4, kGap = 0.35;  // in units of the font's size

using Line = std::pair<glm::dvec2, glm::dvec2>;

/// An edge of the box along `axis`; the other two axes have their lower or upper end.
struct Edge {
  int axis;
  glm::dvec3 from, to;  // data coordinates
};

class Box {
 public:
  explicit Box(const AnnotatedScene& scene) : scene_(scene) {
    for (int axis = 0; axis < 3; ++axis)
      for (const bool upper : {false, true}) facing_[axis][upper] = facing(axis, upper);
    for (int axis = 0; axis < 3; ++axis) {
      double longest = 0;
      for (int n = 0; n < 4; ++n)
        if (const auto line = lineOf(edge(axis, n & 1, n & 2)))
          longest = std::max(longest, glm::distance(line->first, line->second));
      const double low = scene.lower[axis], high = scene.upper[axis];
      const int wanted = ticksAlong(longest, fontSize(scene.view.size, scene.text_size));
      if (std::isfinite(low) && std::isfinite(high) && low < high)
        ticks_[axis] = axisTicks({{low, high}}, wanted);
    }
  }

  const std::vector<AxisTick>& ticks(int axis) const { return ticks_[axis]; }

  Edge edge(int axis, bool upper_b, bool upper_c) const {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    Edge e{axis, scene_.lower, scene_.lower};
    e.from[b] = e.to[b] = upper_b ? scene_.upper[b] : scene_.lower[b];
    e.from[c] = e.to[c] = upper_c ? scene_.upper[c] : scene_.lower[c];
    e.to[axis] = scene_.upper[axis];
    return e;
  }

  std::optional<Line> lineOf(const Edge& e) const { return lineOf(e.from, e.to); }
  std::optional<Line> lineOf(const glm::dvec3& a, const glm::dvec3& b) const {
    return lineInImage(scene_.view, scene_.view.viewFromData(a), scene_.view.viewFromData(b));
  }

  /// Whether the side at one end of an axis is seen from outside (1), from inside (-1), or edge-on.
  int seen(int axis, bool upper) const { return facing_[axis][upper]; }

  /// The edge along an axis that has its coordinates: one of the outline, below or at the left if possible.
  std::optional<Edge> labelled(int axis) const {
    std::optional<Edge> best;
    double best_score = 0;
    for (int n = 0; n < 4; ++n) {
      const bool of_b = n & 1, of_c = n & 2;
      if ((seen((axis + 1) % 3, of_b) > 0) == (seen((axis + 2) % 3, of_c) > 0)) continue;
      const Edge e = edge(axis, of_b, of_c);
      const auto line = lineOf(e);
      if (!line) continue;
      const glm::dvec2 along = glm::abs(line->second - line->first),
                       middle = 0.5 * (line->first + line->second);
      const double score = middle.y * along.x - middle.x * along.y;
      if (best && score <= best_score) continue;
      best = e;
      best_score = score;
    }
    return best;
  }

 private:
  int facing(int axis, bool upper) const {
    const ScreenView& view = scene_.view;
    glm::dvec3 at = 0.5 * (scene_.lower + scene_.upper);
    at[axis] = upper ? scene_.upper[axis] : scene_.lower[axis];
    const glm::dvec3 in_view = view.viewFromData(at);
    const glm::dvec3 ray =
        view.projection == Projection::kPerspective ? glm::normalize(in_view) : glm::dvec3(0, 0, 1);
    // Sides are at right angles to the axes before and after --scale.
    const glm::dvec3 outward =
        (upper ? 1.0 : -1.0) * glm::dvec3(view.right[axis], view.down[axis], view.forward[axis]);
    const double away = glm::dot(outward, ray);
    return std::abs(away) < kEdgeOn ? 0 : away < 0 ? 1 : -1;
  }

  const AnnotatedScene& scene_;
  std::array<std::array<int, 2>, 3> facing_{};
  std::array<std::vector<AxisTick>, 3> ticks_;
};

void add(cairo_t* cairo, const std::optional<Line>& line) {
  if (!line) return;
  cairo_move_to(cairo, line->first.x, line->first.y);
  cairo_line_to(cairo, line->second.x, line->second.y);
}

/// Lines of one side, at right angles to `axis`.
void addSide(cairo_t* cairo, const AnnotatedScene& scene, const Box& box, int axis, bool upper) {
  for (const int along : {(axis + 1) % 3, (axis + 2) % 3}) {
    const int across = 3 - axis - along;
    glm::dvec3 from = scene.lower, to = scene.upper;
    from[axis] = to[axis] = upper ? scene.upper[axis] : scene.lower[axis];
    for (const AxisTick& tick : box.ticks(across)) {
      from[across] = to[across] = tick.value;
      add(cairo, box.lineOf(from, to));
    }
  }
}

void drawLabels(cairo_t* cairo, const AnnotatedScene& scene, const Box& box, int axis) {
  const std::optional<Edge> edge = box.labelled(axis);
  const std::optional<Line> line = edge ? box.lineOf(*edge) : std::nullopt;
  if (!line) return;
  LabelledEdge labelled{line->first,
                        0.5 * (line->first + line->second),
                        line->second,
                        {},
                        scene.axis_titles[static_cast<size_t>(axis)]};
  for (const AxisTick& tick : box.ticks(axis)) {
    glm::dvec3 at = edge->from;
    at[axis] = tick.value;
    if (const auto point = box.lineOf(at, at)) labelled.ticks.emplace_back(point->first, tick.label);
  }
  drawEdgeLabels(cairo, scene, labelled,
                 scene.view.pixelFromView(scene.view.viewFromData(0.5 * (scene.lower + scene.upper))));
  add(cairo, line);
  cairo_stroke(cairo);
}

}  // namespace

int ticksAlong(double edge_px, double font_px) {
  constexpr double kLabelSpace = 4.5;  // between ticks, in units of the font's size
  return std::clamp(static_cast<int>(edge_px / (kLabelSpace * font_px)), 3, kMaxTicks);
}

void drawEdgeLabels(cairo_t* cairo, const AnnotatedScene& scene, const LabelledEdge& edge,
                    const glm::dvec2& centre) {
  const double font = fontSize(scene.view.size, scene.text_size);
  if (!(glm::distance(edge.from, edge.to) > edge.shortest * font)) return;
  const glm::dvec2 along = glm::normalize(edge.to - edge.from);
  glm::dvec2 outward(-along.y, along.x);
  if (glm::dot(outward, edge.middle - centre) < 0) outward = -outward;
  // Text that would be cut off at the picture's edge is moved into it, and made smaller if it is too long.
  const auto drawInside = [&](glm::dvec2 at, const std::string& text) {
    const glm::dvec2 image(scene.view.size.width, scene.view.size.height);
    cairo_save(cairo);
    fitFont(cairo, font, text, image.x - 2);
    cairo_text_extents_t of;
    cairo_text_extents(cairo, text.c_str(), &of);
    const glm::dvec2 half = 0.5 * glm::dvec2(of.width, of.height) + 1.0;
    at = glm::max(half, glm::min(at, image - half));
    drawText(cairo, at, text);
    cairo_restore(cairo);
  };
  const auto extents = [&](const std::string& text) {
    cairo_text_extents_t of;
    cairo_text_extents(cairo, text.c_str(), &of);
    return glm::dvec2(of.width, of.height);
  };
  /// How far text reaches along `outward` from where it begins.
  const auto depth = [&](const glm::dvec2& size) {
    return std::abs(outward.x) * size.x + std::abs(outward.y) * size.y;
  };
  cairo_set_line_width(cairo, std::max(1.0, font / 12));
  double deepest = 0;
  std::optional<std::pair<glm::dvec2, glm::dvec2>> last;  // a label's place and size
  for (const auto& [point, label] : edge.ticks) {
    const glm::dvec2 end = point + kTick * font * outward;
    const glm::dvec2 needed = last ? 0.5 * (last->second + extents(label)) + 0.2 * font : glm::dvec2(0.0);
    if (last && std::abs(point.x - last->first.x) < needed.x && std::abs(point.y - last->first.y) < needed.y)
      continue;
    last = {point, extents(label)};
    add(cairo, Line(point, end));
    const glm::dvec2 size = extents(label);
    deepest = std::max(deepest, depth(size));
    cairo_stroke(cairo);
    drawInside(end + (kGap * font + 0.5 * depth(size)) * outward, label);
  }
  if (edge.title.empty()) return;
  const double away = (kTick + 3 * kGap) * font + deepest + 0.5 * depth(extents(edge.title));
  drawInside(edge.middle + away * outward, edge.title);
}

void drawAxesGrid(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  if (scene.on_globe) return drawGlobeGrid(cairo, scene, ink);
  const Box box(scene);
  cairo_set_line_width(cairo, std::max(1.0, fontSize(scene.view.size, scene.text_size) / 14));
  for (int axis = 0; axis < 3; ++axis)
    for (const bool upper : {false, true}) {
      if (box.seen(axis, upper) >= 0) continue;
      addSide(cairo, scene, box, axis, upper);
      setInk(cairo, ink, 0.2);
      cairo_stroke(cairo);
      // The edges of the side.
      for (const int along : {(axis + 1) % 3, (axis + 2) % 3})
        for (const bool other : {false, true}) {
          const bool axis_first = (along + 1) % 3 == axis;
          add(cairo, box.lineOf(box.edge(along, axis_first ? upper : other, axis_first ? other : upper)));
        }
      setInk(cairo, ink, 0.5);
      cairo_stroke(cairo);
    }
}

void drawAxesLabels(cairo_t* cairo, const AnnotatedScene& scene, const glm::dvec3& ink) {
  if (scene.on_globe) return drawGlobeLabels(cairo, scene, ink);
  const Box box(scene);
  setInk(cairo, ink);
  for (int axis = 0; axis < 3; ++axis) drawLabels(cairo, scene, box, axis);
}

}  // namespace curvisplat
