#include "render/surface/surface_shader.h"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cfloat>
#include <cmath>
#include <vector>

#include "render/mesh/curve_set.h"
#include "render/surface/map_image.h"

namespace curvisplat {
namespace {

const Light kMatt = [] {
  Light light;
  light.specular = 0;
  return light;
}();

}  // namespace

SurfaceLight::SurfaceLight(const std::optional<Light>& light, const ScreenView& view)
    : light_(light.value_or(kMatt)), per_scale_(1.0 / view.scale) {
  if (light_.towards) towards_ = glm::vec3(glm::normalize(*light_.towards));
}

/// Lights a colour without a branch, so that compilers make vectors of a loop of it.
template <bool kAtViewer>
inline glm::vec3 SurfaceLight::litBy(const glm::vec3& colour, const glm::vec3& normal,
                                     const glm::vec3& towards_viewer) const {
  const glm::vec3 stretched = normal * per_scale_;
  const float length = std::sqrt(glm::dot(stretched, stretched));
  const glm::vec3 n = stretched / length;
  const float facing = std::min(1.0f, std::abs(glm::dot(n, kAtViewer ? towards_viewer : towards_)));
  float shine = facing;
  if constexpr (!kAtViewer) {
    const glm::vec3 half = towards_ + towards_viewer;
    const float of_half = std::sqrt(glm::dot(half, half));
    const float of_normal = std::min(1.0f, std::abs(glm::dot(n, half)) / of_half);
    shine = of_half > 1e-6f ? of_normal : 0.0f;
  }
  for (int power = 0; power < 5; ++power) shine *= shine;  // to the power of 32
  const bool known = length > 0;
  const float factor = known ? light_.ambient + light_.diffuse * facing : 1.0f;
  const float white = known ? light_.specular * shine : 0.0f;
  return {std::min(factor * colour.x + white, 1.0f), std::min(factor * colour.y + white, 1.0f),
          std::min(factor * colour.z + white, 1.0f)};
}

glm::vec3 SurfaceLight::lit(const glm::vec3& colour, const glm::vec3& normal,
                            const glm::vec3& towards_viewer) const {
  return light_.towards ? litBy<false>(colour, normal, towards_viewer)
                        : litBy<true>(colour, normal, towards_viewer);
}

template <bool kAtViewer>
void SurfaceLight::lightBy(LitPoints& points, size_t count) const {
  const auto at = [](const LitPoints::Vectors& vectors, size_t n) {
    return glm::vec3(vectors[0][n], vectors[1][n], vectors[2][n]);
  };
  const SurfaceLight light = *this;  // which the points cannot overlap
  for (size_t n = 0; n < count; ++n) {
    const glm::vec3 lit =
        light.litBy<kAtViewer>(at(points.colour, n), at(points.normal, n), at(points.towards_viewer, n));
    points.colour[0][n] = lit.x;
    points.colour[1][n] = lit.y;
    points.colour[2][n] = lit.z;
  }
}

void SurfaceLight::light(LitPoints& points, size_t count) const {
  light_.towards ? lightBy<false>(points, count) : lightBy<true>(points, count);
}

SurfaceShader::SurfaceShader(const SceneTriangles& triangles, const Tables& tables,
                             const std::optional<Light>& light)
    : triangles_(triangles), tables_(tables), light_(light, triangles.view()), has_light_(light.has_value()) {
  for (const Surface& surface : triangles.scene().surfaces) {
    has_scalars_ = has_scalars_ || (surface.by_scalar && !surface.mesh->scalars.empty());
    has_others_ = has_others_ || (surface.opacity.by_function && !surface.mesh->opacity_scalars.empty());
  }
}

/// The corners of the triangles of spots.
struct SurfaceShader::Corners {
  using Row = std::array<float, kAtOnce>;
  alignas(64) Row at_x, at_y;  // the spots
  std::array<Row, 3> x, y, value;
  std::array<Row, 3> normal_x, normal_y, normal_z;
  std::array<Row, 3> scalar, other;  // NaN: none
};

/// The values that the corners make together at the spots.
struct SurfaceShader::Mixed {
  using Row = std::array<float, kAtOnce>;
  alignas(64) Row normal_x, normal_y, normal_z;
  Row scalar, other;
};

void SurfaceShader::gather(std::span<const Spot> spots, Corners& out) const {
  const auto take = [&](const std::vector<float>& from, const std::array<uint32_t, 3>& corners, size_t n,
                        std::array<Corners::Row, 3>& to) {
    for (size_t c = 0; c < 3; ++c) to[c][n] = from.empty() ? NAN : from[corners[c]];
  };
  for (size_t n = 0; n < spots.size(); ++n) {
    const auto [number, triangle] = triangles_.placeOf(spots[n].number);
    if (triangles_.isCurve(number)) continue;
    const Surface& surface = triangles_.scene().surfaces[number];
    const TriangleMesh& mesh = *surface.mesh;
    const auto& corners = mesh.triangles[triangle];
    const std::vector<ScreenVertex>& vertices = triangles_.verticesOf(number);
    out.at_x[n] = spots[n].x;
    out.at_y[n] = spots[n].y;
    for (size_t c = 0; c < 3; ++c) {
      const ScreenVertex& vertex = vertices[corners[c]];
      const glm::vec3& normal = mesh.normals[corners[c]];
      out.x[c][n] = vertex.x;
      out.y[c][n] = vertex.y;
      out.value[c][n] = vertex.value;
      out.normal_x[c][n] = normal.x;
      out.normal_y[c][n] = normal.y;
      out.normal_z[c][n] = normal.z;
    }
    static const std::vector<float> kNone;
    if (has_scalars_) take(surface.by_scalar ? mesh.scalars : kNone, corners, n, out.scalar);
    if (has_others_) take(mesh.opacity_scalars, corners, n, out.other);
  }
}

template <bool kPerspective>
void SurfaceShader::mix(const Corners& __restrict c, size_t count, Mixed& __restrict out) {
  for (size_t n = 0; n < count; ++n) {
    const float x = c.at_x[n], y = c.at_y[n];
    const auto cross = [&](size_t a, size_t b) {
      return (c.x[a][n] - x) * (c.y[b][n] - y) - (c.y[a][n] - y) * (c.x[b][n] - x);
    };
    float a = cross(1, 2), b = cross(2, 0), d = cross(0, 1);
    const float sign = a + b + d < 0 ? -1.0f : 1.0f;
    a = std::max(sign * a, 0.0f);
    b = std::max(sign * b, 0.0f);
    d = std::max(sign * d, 0.0f);
    if constexpr (kPerspective) {
      a *= -c.value[0][n];
      b *= -c.value[1][n];
      d *= -c.value[2][n];
    }
    const float sum = a + b + d;
    const bool known = (sum > 0) & (std::abs(sum) <= FLT_MAX);
    a = known ? a / sum : 1.0f / 3;
    b = known ? b / sum : 1.0f / 3;
    d = known ? d / sum : 1.0f / 3;
    // Normals are of either side: those on the first one's.
    const auto sideOf = [&](size_t corner) {
      return c.normal_x[corner][n] * c.normal_x[0][n] + c.normal_y[corner][n] * c.normal_y[0][n] +
                         c.normal_z[corner][n] * c.normal_z[0][n] <
                     0
                 ? -1.0f
                 : 1.0f;
    };
    const float side1 = sideOf(1), side2 = sideOf(2);
    const auto mean = [&](const std::array<Corners::Row, 3>& of) {
      return a * of[0][n] + b * (side1 * of[1][n]) + d * (side2 * of[2][n]);
    };
    out.normal_x[n] = mean(c.normal_x);
    out.normal_y[n] = mean(c.normal_y);
    out.normal_z[n] = mean(c.normal_z);
    out.scalar[n] = a * c.scalar[0][n] + b * c.scalar[1][n] + d * c.scalar[2][n];
    out.other[n] = a * c.other[0][n] + b * c.other[1][n] + d * c.other[2][n];
  }
}

void SurfaceShader::shadeBlock(std::span<const Spot> spots, std::span<Point> points) const {
  if (!triangles_.scene().surfaces.empty()) shadeTriangles(spots, points);
  if (!triangles_.scene().curves.empty()) shadeCapsules(spots, points);
}

/// Shades those of the spots that see triangles.
void SurfaceShader::shadeTriangles(std::span<const Spot> spots, std::span<Point> points) const {
  Corners corners{};  // those of capsules are not used
  const auto clear = [](std::array<Corners::Row, 3>& rows) {
    for (Corners::Row& row : rows) row.fill(NAN);
  };
  if (!has_scalars_) clear(corners.scalar);
  if (!has_others_) clear(corners.other);
  gather(spots, corners);
  Mixed mixed;
  if (triangles_.view().projection == Projection::kPerspective)
    mix<true>(corners, spots.size(), mixed);
  else
    mix<false>(corners, spots.size(), mixed);
  for (size_t n = 0; n < spots.size(); ++n) {
    const size_t number = triangles_.placeOf(spots[n].number).surface;
    Point& point = points[n];
    if (triangles_.isCurve(number)) continue;
    const Surface& surface = triangles_.scene().surfaces[number];
    point.normal = {mixed.normal_x[n], mixed.normal_y[n], mixed.normal_z[n]};
    point.opacity = static_cast<float>(surface.opacity.factor);
    const ColourTable& colours = surface.colours ? *surface.colours : tables_.colours;
    const float scalar = mixed.scalar[n];
    point.scalar = isovalueOf(number);
    if (!std::isnan(point.scalar) && !std::isnan(scalar)) point.scalar = scalar;
    point.colour = std::isnan(scalar) || surface.own_colour ? surface.colour : colours.at(double{scalar});
    if (surface.map && std::isnan(scalar)) shadeMap(spots[n], *surface.map, point);
    if (!surface.opacity.by_function) continue;
    const bool has_other = !surface.mesh->opacity_scalars.empty() && tables_.opacities;
    const float of_opacity = has_other ? mixed.other[n] : scalar;
    if (!std::isnan(of_opacity))
      point.opacity *= (has_other ? *tables_.opacities : colours).opacityAt(double{of_opacity});
  }
}

/// Turns the normal of a wide tube as evenly as if the line were a smooth curve: at a joint it is at right angles to the
/// mean of both directions. Joints of more than 60 degrees stay sharp.
void SurfaceShader::smoothJoints(size_t curve, uint32_t end, CapsulePlace& place) const {
  constexpr float kSharpest = 0.5f;  // cosine of the angle between directions
  const CapsuleLook& look = triangles_.lookOf(curve);
  const auto axisAt = [&](uint32_t point) { return axisOf(triangles_.capsuleOf(curve, point), look); };
  const uint32_t begin = triangles_.beginOf(curve, end);
  const auto& points = triangles_.verticesOf(curve);
  const glm::vec3 axis = axisAt(end);
  glm::vec3 first = axis, last = axis;
  const auto join = [&](uint32_t other, glm::vec3& at) {
    const glm::vec3 of_other = axisAt(other);
    if (!(glm::dot(of_other, axis) > kSharpest)) return false;
    at += of_other;
    return true;
  };
  const bool goes_on_before =
      triangles_.beginOf(curve, begin) != SceneTriangles::kNoCapsule && begin != end && join(begin, first);
  uint32_t next = end + 1;
  while (next < points.size() && triangles_.beginOf(curve, next) == SceneTriangles::kNoCapsule) ++next;
  const bool goes_on_after =
      next < points.size() && triangles_.beginOf(curve, next) == end && join(next, last);
  if ((place.along <= 0 && !goes_on_before) || (place.along >= 1 && !goes_on_after)) return;
  const float along = std::clamp(place.along, 0.0f, 1.0f);
  const glm::vec3 tangent = (1 - along) * glm::normalize(first) + along * glm::normalize(last);
  const glm::vec3 across =
      place.normal - glm::dot(place.normal, tangent) / glm::dot(tangent, tangent) * tangent;
  const float length = glm::length(across);
  if (length > 0.1f) place.normal = across / length;
}

/// Shades those of the spots that see capsules.
void SurfaceShader::shadeCapsules(std::span<const Spot> spots, std::span<Point> points) const {
  CapsuleSpots capsules;
  std::array<uint8_t, kAtOnce> of_capsules;
  size_t last = 0;
  for (size_t n = 0; n < spots.size(); ++n) {
    const auto [curve, end] = triangles_.placeOf(spots[n].number);
    if (!triangles_.isCurve(curve)) continue;
    of_capsules[capsules.size()] = static_cast<uint8_t>(n);
    capsules.add(triangles_.capsuleOf(curve, end), triangles_.lookOf(curve), spots[n].x, spots[n].y);
    last = curve;
  }
  if (capsules.size() == 0) return;
  capsules.findPlaces(triangles_.lookOf(last));
  for (size_t n = 0; n < capsules.size(); ++n)
    shadeCapsule(spots[of_capsules[n]], capsules.place(n), points[of_capsules[n]]);
}

void SurfaceShader::shadeCapsule(const Spot& spot, CapsulePlace place, Point& point) const {
  const auto [curve, end] = triangles_.placeOf(spot.number);
  const Curves& curves = triangles_.curvesOf(curve);
  const ScreenView& view = triangles_.view();
  constexpr float kWide = 2;  // pixels
  const CapsuleLook& look = triangles_.lookOf(curve);
  const Capsule capsule = triangles_.capsuleOf(curve, end);
  if (look.radiusAt(capsule.a.value) > kWide) smoothJoints(curve, end, place);
  const glm::dvec3 stretched = double{place.normal.x} * view.right + double{place.normal.y} * view.down +
                               double{place.normal.z} * view.forward;
  point.normal = glm::vec3(stretched * view.scale);
  point.opacity = static_cast<float>(curves.opacity);
  point.scalar = NAN;
  point.colour = curves.colour;
  const std::vector<float>& values = curves.set->values;
  if (values.empty()) return;
  const auto [from, to] = triangles_.partsOf(curve, end, capsule);
  const float begin = values[triangles_.beginOf(curve, end)];
  const float along = std::clamp(from + place.along * (to - from), 0.0f, 1.0f);
  const float scalar = begin + along * (values[end] - begin);
  if (!std::isnan(scalar))
    point.colour = (curves.colours ? *curves.colours : tables_.colours).at(double{scalar});
}

/// The point of a triangle that a ray meets, in data coordinates; within the triangle, whose plane may be seen edge-on.
glm::dvec3 SurfaceShader::placeSeen(const Spot& spot) const {
  const auto [number, triangle] = triangles_.placeOf(spot.number);
  const TriangleMesh& mesh = *triangles_.scene().surfaces[number].mesh;
  const ScreenView& view = triangles_.view();
  std::array<glm::dvec3, 3> corners;  // stretched, from the eye
  for (size_t c = 0; c < 3; ++c)
    corners[c] =
        view.scale * (mesh.origin + glm::dvec3(mesh.positions[mesh.triangles[triangle][c]])) - view.eye;
  const double x = (double{spot.x} - 0.5 * view.size.width) / view.focal_px,
               y = (double{spot.y} - 0.5 * view.size.height) / view.focal_px;
  const glm::dvec3 aside = x * view.right + y * view.down;
  const bool perspective = view.projection == Projection::kPerspective;
  const glm::dvec3 way = perspective ? aside + view.forward : view.forward;
  if (!perspective)
    for (glm::dvec3& corner : corners) corner -= aside;
  // The volumes of the tetrahedra that the ray makes with the edges.
  double sum = 0, sign = 0;
  std::array<double, 3> shares;
  for (size_t c = 0; c < 3; ++c) {
    shares[c] = glm::dot(way, glm::cross(corners[(c + 1) % 3], corners[(c + 2) % 3]));
    sign += shares[c];
  }
  glm::dvec3 place(0.0);
  for (size_t c = 0; c < 3; ++c) {
    const double share = std::max(sign < 0 ? -shares[c] : shares[c], 0.0);
    place += share * corners[c];
    sum += share;
  }
  place = sum > 0 ? place / sum : (corners[0] + corners[1] + corners[2]) / 3.0;
  if (!perspective) place += aside;
  return (place + view.eye) / view.scale;
}

/// Gives a point the map's colour; without a light of the picture it is that of the image.
void SurfaceShader::shadeMap(const Spot& spot, const PlacedMap& map, Point& point) const {
  const ScreenView& view = triangles_.view();
  const glm::dvec3 place = placeSeen(spot), &scale = view.scale;
  const double stretch =
      map.globe.sphere() ? std::min({scale.x, scale.y, scale.z}) : std::sqrt(scale.x * scale.y);
  const bool perspective = view.projection == Projection::kPerspective;
  point.colour = map.at(place, (perspective ? view.viewFromData(place).z : 1) / view.focal_px / stretch);
  if (!has_light_) point.normal = glm::vec3(0.0f);
}

/// The value of an isosurface; NaN of another surface.
float SurfaceShader::isovalueOf(size_t surface) const {
  const size_t first = triangles_.scene().surfaces.size() - tables_.isovalues.size();
  return surface < first ? NAN : static_cast<float>(tables_.isovalues[surface - first]);
}

void SurfaceShader::shade(std::span<const Spot> spots, std::span<Point> points) const {
  for (size_t begin = 0; begin < spots.size(); begin += kAtOnce) {
    const size_t count = std::min(kAtOnce, spots.size() - begin);
    shadeBlock(spots.subspan(begin, count), points.subspan(begin, count));
  }
}

bool SurfaceShader::meet(uint32_t a, uint32_t b) const {
  const auto [surface, triangle] = triangles_.placeOf(a);
  const auto [other_surface, other_triangle] = triangles_.placeOf(b);
  if (surface != other_surface) return false;
  if (triangles_.isCurve(surface)) {
    const uint32_t begin = triangles_.beginOf(surface, triangle),
                   other_begin = triangles_.beginOf(surface, other_triangle);
    return begin == other_triangle || triangle == other_begin || begin == other_begin;
  }
  const TriangleMesh& mesh = *triangles_.scene().surfaces[surface].mesh;
  const auto &x = mesh.triangles[triangle], &y = mesh.triangles[other_triangle];
  bool any = false;
  for (size_t n = 0; n < 3; ++n) any |= (x[n] == y[0]) | (x[n] == y[1]) | (x[n] == y[2]);
  return any;
}

/// The slope of the axis, and that of the round sides but for their outermost part.
static float capsuleSteepness(const Capsule& capsule, const ScreenView& view) {
  constexpr float kRound = 2;  // pixels
  const auto& [a, b] = capsule;
  const float pixel = (view.projection == Projection::kPerspective ? std::abs(a.value) : 1.0f) /
                      static_cast<float>(view.focal_px);
  const float steep =
      std::abs(b.value - a.value) / std::sqrt((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y)) +
      kRound * pixel;
  return std::isfinite(steep) ? steep : 1e30f;
}

float SurfaceShader::steepness(uint32_t number) const {
  const auto [surface, triangle] = triangles_.placeOf(number);
  if (triangles_.isCurve(surface))
    return capsuleSteepness(triangles_.capsuleOf(surface, triangle), triangles_.view());
  const auto& corners = triangles_.scene().surfaces[surface].mesh->triangles[triangle];
  const ScreenVertex &a = triangles_.vertex(surface, corners[0]), &b = triangles_.vertex(surface, corners[1]),
                     &c = triangles_.vertex(surface, corners[2]);
  const float area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  const float by_x = (b.value - a.value) * (c.y - a.y) - (c.value - a.value) * (b.y - a.y);
  const float by_y = (c.value - a.value) * (b.x - a.x) - (b.value - a.value) * (c.x - a.x);
  const float steep = (std::abs(by_x) + std::abs(by_y)) / std::abs(area);
  return std::isfinite(steep) ? steep : 1e30f;
}

}  // namespace curvisplat
