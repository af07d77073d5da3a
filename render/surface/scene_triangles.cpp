#include "render/surface/scene_triangles.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "stream/base/huge_pages.h"

namespace curvisplat {
namespace {

constexpr size_t kVerticesAtOnce = 4096;

}  // namespace

SceneTriangles::SceneTriangles(const SurfaceScene& scene, const ScreenView& view, double depth_origin,
                               ScreenVertices memory)
    : scene_(scene), view_(view), depth_origin_(depth_origin), begins_{0}, vertices_(std::move(memory)) {
  vertices_.resize(scene.surfaces.size());
  for (size_t n = 0; n < scene.surfaces.size(); ++n) {
    const TriangleMesh& mesh = *scene.surfaces[n].mesh;
    begins_.push_back(begins_.back() + static_cast<uint32_t>(mesh.triangles.size()));
    std::vector<ScreenVertex>& out = vertices_[n];
    if (out.capacity() > mesh.positions.size() / 3 * 4 + 1) out = {};  // kept for what needs about as much
    if (out.capacity() < mesh.positions.size()) {
      out = {};
      out.reserve(mesh.positions.size());
      preferHugePages(out.data(), out.capacity() * sizeof(ScreenVertex));
    }
    out.resize(mesh.positions.size());
    projectAll(mesh, out);
  }
}

/// Affine in the mesh's positions, and the perspective divide.
void SceneTriangles::projectAll(const TriangleMesh& mesh, std::vector<ScreenVertex>& out) const {
  const bool perspective = view_.projection == Projection::kPerspective;
  const glm::dvec3 origin = view_.viewFromData(mesh.origin);
  const glm::dvec3 right = view_.right * view_.scale, down = view_.down * view_.scale,
                   forward = view_.forward * view_.scale;
  tbb::parallel_for(tbb::blocked_range<size_t>(0, out.size(), kVerticesAtOnce), [&](const auto& range) {
    const auto inView = [&](size_t n) {
      const double x = mesh.positions[n].x, y = mesh.positions[n].y, z = mesh.positions[n].z;
      return glm::dvec3(origin.x + (right.x * x + right.y * y + right.z * z),
                        origin.y + (down.x * x + down.y * y + down.z * z),
                        origin.z + (forward.x * x + forward.y * y + forward.z * z));
    };
    if (perspective) {
      for (size_t n = range.begin(); n < range.end(); ++n) out[n] = project(inView(n));
      return;
    }
    // As project(), without its branch, so that compilers make vectors of it.
    const double pixels = view_.focal_px, middle_x = 0.5 * view_.size.width,
                 middle_y = 0.5 * view_.size.height, depth_origin = depth_origin_;
    ScreenVertex* const to = out.data();
    for (size_t n = range.begin(); n < range.end(); ++n) {
      const glm::dvec3 at = inView(n);
      to[n] = {static_cast<float>(middle_x + pixels * at.x), static_cast<float>(middle_y + pixels * at.y),
               static_cast<float>(at.z - depth_origin)};
    }
  });
}

glm::dvec3 SceneTriangles::inView(size_t surface, uint32_t vertex) const {
  const TriangleMesh& mesh = *scene_.surfaces[surface].mesh;
  return view_.viewFromData(mesh.origin + glm::dvec3(mesh.positions[vertex]));
}

ScreenVertex SceneTriangles::project(const glm::dvec3& in_view) const {
  double pixels = view_.focal_px, value = in_view.z - depth_origin_;
  if (view_.projection == Projection::kPerspective) {
    if (!(in_view.z >= view_.near)) return {0, 0, std::numeric_limits<float>::quiet_NaN()};
    const double inverse = 1 / in_view.z;
    pixels *= inverse;
    value = -inverse;
  }
  return {static_cast<float>(0.5 * view_.size.width + pixels * in_view.x),
          static_cast<float>(0.5 * view_.size.height + pixels * in_view.y), static_cast<float>(value)};
}

NearPolygon SceneTriangles::behindNear(size_t surface, const std::array<uint32_t, 3>& corners) const {
  std::array<glm::dvec3, 3> in_view;
  for (size_t n = 0; n < 3; ++n) in_view[n] = inView(surface, corners[n]);
  NearPolygon polygon;
  for (size_t n = 0; n < 3; ++n) {
    const glm::dvec3 &a = in_view[n], &b = in_view[(n + 1) % 3];
    if (a.z >= view_.near) polygon.vertices[polygon.count++] = project(a);
    if ((a.z >= view_.near) == (b.z >= view_.near)) continue;
    glm::dvec3 cut = a + (view_.near - a.z) / (b.z - a.z) * (b - a);
    cut.z = view_.near;
    polygon.vertices[polygon.count++] = project(cut);
  }
  return polygon;
}

float SceneTriangles::depthOf(float value, float x, float y) const {
  if (view_.projection != Projection::kPerspective) return value;
  const double across = (static_cast<double>(x) - 0.5 * view_.size.width) / view_.focal_px;
  const double down = (static_cast<double>(y) - 0.5 * view_.size.height) / view_.focal_px;
  return static_cast<float>(-1 / static_cast<double>(value) * std::sqrt(1 + across * across + down * down));
}

SceneTriangles::Place SceneTriangles::placeOfSeveral(uint32_t number) const {
  const auto after = std::upper_bound(begins_.begin(), begins_.end(), number);
  const auto surface = static_cast<size_t>(after - begins_.begin()) - 1;
  return {surface, number - begins_[surface]};
}

}  // namespace curvisplat
