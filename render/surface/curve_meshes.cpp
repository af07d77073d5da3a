#include "render/surface/curve_meshes.h"

#include <tbb/parallel_for.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "render/mesh/curve_set.h"
#include "render/mesh/triangle_mesh.h"

namespace curvisplat {
namespace {

constexpr double kNearestPx = 0.5;  // points of a line that are drawn
constexpr double kSharpest = 0.5;   // cosine of the angle by which a tube turns
constexpr size_t kLinesAtOnce = 64;

/// Parts of a quarter circle, at most: spheres of a few are finer.
size_t mostParts(const CurveSet& set) {
  const size_t points = set.positions.size();
  return points < 2000 ? 8 : points < 20'000 ? 4 : 2;
}

/// A point of a line in stretched space, as the view sees it.
struct Place {
  glm::dvec3 at, towards;  // the viewer, of length 1
  double radius;
  float value;
};

/// The curves' lines in one view, as meshes.
class Builder {
 public:
  Builder(const Curves& curves, const ScreenView& view)
      : curves_(curves), set_(*curves.set), view_(view), most_parts_(mostParts(set_)) {}

  TriangleMesh mesh() const {
    const size_t batches = (set_.lines() + kLinesAtOnce - 1) / kLinesAtOnce;
    std::vector<TriangleMesh> parts(batches);
    tbb::parallel_for(size_t{0}, batches, [&](size_t batch) {
      std::vector<Place> places;
      const size_t end = std::min(set_.lines(), (batch + 1) * kLinesAtOnce);
      for (size_t line = batch * kLinesAtOnce; line < end; ++line) {
        placesOf(line, places);
        addLine(places, parts[batch]);
      }
    });
    return joined(parts);
  }

 private:
  Place placeOf(size_t point) const {
    const glm::dvec3 data = set_.origin + glm::dvec3(set_.positions[point]);
    const bool perspective = view_.projection == Projection::kPerspective;
    Place place{view_.scale * data, -view_.forward, 0.5 * curves_.width,
                set_.values.empty() ? NAN : set_.values[point]};
    double unit = 1 / view_.focal_px;  // that a pixel shows
    if (perspective) {
      const glm::dvec3 arm = view_.eye - place.at;
      place.towards = arm / std::max(glm::length(arm), 1e-300);
      unit *= std::max(view_.viewFromData(data).z, view_.near);
    }
    if (curves_.in_pixels) place.radius *= unit;
    return place;
  }

  /// The places that the picture tells apart, and both ends.
  void placesOf(size_t line, std::vector<Place>& places) const {
    places.clear();
    const uint32_t begin = set_.begins[line], end = set_.begins[line + 1];
    for (uint32_t n = begin; n < end; ++n) {
      const Place place = placeOf(n);
      if (!places.empty()) {
        const double px = glm::distance(place.at, places.back().at) * pixelsAt(place);
        if (!(px > 0) || (px < kNearestPx && n + 1 < end)) continue;
      }
      places.push_back(place);
    }
  }

  double pixelsAt(const Place& place) const {
    if (view_.projection == Projection::kOrthographic) return view_.focal_px;
    return view_.focal_px / std::max(glm::dot(place.at - view_.eye, view_.forward), view_.near);
  }
  /// Parts of a quarter circle, by how large it is seen.
  size_t partsOf(const Place& place) const {
    const double px = place.radius * pixelsAt(place);
    return std::min(most_parts_, px < 4 ? size_t{2} : px < 16 ? size_t{4} : size_t{8});
  }

  void addLine(const std::vector<Place>& places, TriangleMesh& out) const {
    if (places.empty()) return;
    addSphere(places.front(), out);
    if (places.size() == 1) return;
    size_t parts = 2;
    for (const Place& place : places) parts = std::max(parts, partsOf(place));
    glm::dvec3 before = glm::normalize(places[1].at - places[0].at);
    addRing(places[0], before, parts, out);
    for (size_t n = 1; n < places.size(); ++n) {
      const glm::dvec3 after =
          n + 1 < places.size() ? glm::normalize(places[n + 1].at - places[n].at) : before;
      const bool turns = glm::dot(before, after) < kSharpest;
      addRing(places[n], turns ? before : glm::normalize(before + after), parts, out);
      joinRings(parts, out);
      if (turns) {
        addSphere(places[n], out);
        addRing(places[n], after, parts, out);
      }
      before = after;
    }
    addSphere(places.back(), out);
  }

  void addVertex(const Place& place, const glm::dvec3& normal, TriangleMesh& out) const {
    out.positions.emplace_back((place.at + place.radius * normal) / view_.scale - set_.origin);
    out.normals.emplace_back(glm::normalize(normal * view_.scale));
    if (!set_.values.empty()) out.scalars.push_back(place.value);
  }

  /// Two directions at right angles to `along`, of length 1: one to the side, as the viewer sees it, and one towards the viewer.
  static std::array<glm::dvec3, 2> across(const glm::dvec3& along, const glm::dvec3& towards) {
    glm::dvec3 side = glm::cross(along, towards);
    if (!(glm::dot(side, side) > 1e-12))
      side = glm::cross(along, std::abs(along.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0));
    side = glm::normalize(side);
    return {side, glm::cross(side, along)};
  }

  /// Half of a circle around a tube, from one side to the other: 2 parts + 1 vertices.
  void addRing(const Place& place, const glm::dvec3& along, size_t parts, TriangleMesh& out) const {
    const auto [side, front] = across(along, place.towards);
    for (size_t n = 0; n <= 2 * parts; ++n) {
      const double angle = 0.5 * std::numbers::pi * (static_cast<double>(n) / static_cast<double>(parts) - 1);
      addVertex(place, std::sin(angle) * side + std::cos(angle) * front, out);
    }
  }

  /// Quads between the last two rings.
  static void joinRings(size_t parts, TriangleMesh& out) {
    const auto ring = static_cast<uint32_t>(2 * parts + 1);
    const auto end = static_cast<uint32_t>(out.positions.size());
    const uint32_t second = end - ring, first = second - ring;
    for (uint32_t n = 0; n + 1 < ring; ++n) {
      out.triangles.push_back({first + n, second + n, second + n + 1});
      out.triangles.push_back({first + n, second + n + 1, first + n + 1});
    }
  }

  /// The half that is towards the viewer: circles around its middle.
  void addSphere(const Place& place, TriangleMesh& out) const {
    const size_t parts = partsOf(place), round = 4 * parts;
    const auto [side, other] = across(place.towards, view_.down);
    const auto middle = static_cast<uint32_t>(out.positions.size());
    addVertex(place, place.towards, out);
    for (size_t ring = 1; ring <= parts; ++ring) {
      const double away = 0.5 * std::numbers::pi * static_cast<double>(ring) / static_cast<double>(parts);
      for (size_t n = 0; n < round; ++n) {
        const double angle = 2 * std::numbers::pi * static_cast<double>(n) / static_cast<double>(round);
        addVertex(place,
                  std::cos(away) * place.towards +
                      std::sin(away) * (std::cos(angle) * side + std::sin(angle) * other),
                  out);
        const auto at = [&](size_t of_ring, size_t k) {
          return of_ring == 0 ? middle
                              : middle + 1 + static_cast<uint32_t>((of_ring - 1) * round + k % round);
        };
        out.triangles.push_back({at(ring - 1, n), at(ring, n), at(ring, n + 1)});
        if (ring > 1) out.triangles.push_back({at(ring - 1, n), at(ring, n + 1), at(ring - 1, n + 1)});
      }
    }
  }

  TriangleMesh joined(const std::vector<TriangleMesh>& parts) const {
    TriangleMesh whole;
    whole.origin = set_.origin;
    std::vector<size_t> vertices{0}, triangles{0};
    for (const TriangleMesh& part : parts) {
      vertices.push_back(vertices.back() + part.positions.size());
      triangles.push_back(triangles.back() + part.triangles.size());
    }
    whole.positions.resize(vertices.back());
    whole.normals.resize(vertices.back());
    whole.triangles.resize(triangles.back());
    if (!set_.values.empty()) whole.scalars.resize(vertices.back());
    tbb::parallel_for(size_t{0}, parts.size(), [&](size_t n) {
      const TriangleMesh& part = parts[n];
      const auto first = static_cast<ptrdiff_t>(vertices[n]);
      std::copy(part.positions.begin(), part.positions.end(), whole.positions.begin() + first);
      std::copy(part.normals.begin(), part.normals.end(), whole.normals.begin() + first);
      std::copy(part.scalars.begin(), part.scalars.end(), whole.scalars.begin() + first);
      for (size_t t = 0; t < part.triangles.size(); ++t)
        for (size_t c = 0; c < 3; ++c)
          whole.triangles[triangles[n] + t][c] = part.triangles[t][c] + static_cast<uint32_t>(first);
    });
    return whole;
  }

  const Curves& curves_;
  const CurveSet& set_;
  const ScreenView& view_;
  const size_t most_parts_;
};

}  // namespace

std::vector<Surface> curveSurfaces(const SurfaceScene& scene, const ScreenView& view) {
  std::vector<Surface> surfaces;
  for (const Curves& curves : scene.curves) {
    Surface& surface = surfaces.emplace_back();
    surface.mesh = std::make_shared<TriangleMesh>(Builder(curves, view).mesh());
    surface.colour = curves.colour;
    surface.by_scalar = !curves.set->values.empty();
    surface.colours = curves.colours;
    surface.opacity = {curves.opacity};
  }
  return surfaces;
}

std::vector<Curves> curvesAt(std::vector<Curves> curves, double time) {
  constexpr double kBefore = -std::numeric_limits<double>::infinity();
  for (Curves& one : curves)
    if (one.whole)
      one.set = std::make_shared<CurveSet>(
          one.places ? placesAt(*one.whole, time)
                     : partBetween(*one.whole, one.tail ? time - *one.tail : kBefore, time));
  return curves;
}

std::shared_ptr<const SurfaceScene> sceneAtTime(std::shared_ptr<const SurfaceScene> scene, double time) {
  const auto has_times = [](const Curves& one) { return one.whole != nullptr; };
  if (!scene || std::none_of(scene->curves.begin(), scene->curves.end(), has_times)) return scene;
  auto timed = std::make_shared<SurfaceScene>(*scene);
  timed->curves = curvesAt(std::move(timed->curves), time);
  return timed;
}

uint64_t curveBytes(const SurfaceScene& scene) {
  // Bytes of a vertex and of a triangle: in a mesh, and before it is joined; on the screen and in tiles.
  constexpr uint64_t kVertex = 2 * 28 + 16, kTriangle = 2 * 12 + 8;
  uint64_t bytes = 0;
  for (const Curves& curves : scene.curves) {
    const uint64_t parts = mostParts(*curves.set), spheres = 2 * curves.set->lines();
    bytes += curves.set->positions.size() * (kVertex * (2 * parts + 1) + kTriangle * 4 * parts) +
             spheres * (kVertex * (4 * parts * parts + 1) + kTriangle * 8 * parts * parts);
  }
  return bytes;
}

}  // namespace curvisplat
