#include "render/surface/scene_triangles.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/mesh/curve_set.h"
#include "render/surface/capsule.h"
#include "stream/base/memory.h"

namespace curvisplat {
namespace {

constexpr size_t kVerticesAtOnce = 4096;
constexpr uint32_t kTrianglesAtOnce = 4096;

}  // namespace

SceneTriangles::SceneTriangles(const SurfaceScene& scene, const ScreenView& view, double depth_origin,
                               ScreenVertices memory)
    : scene_(scene), view_(view), depth_origin_(depth_origin), begins_{0}, vertices_(std::move(memory)) {
  const size_t sheets = scene.surfaces.size() + scene.curves.size();
  vertices_.resize(sheets);
  for (size_t n = 0; n < sheets; ++n) {
    const std::vector<glm::vec3>& positions = positionsOf(n);
    const size_t count = isCurve(n) ? positions.size() : scene.surfaces[n].mesh->triangles.size();
    begins_.push_back(begins_.back() + static_cast<uint32_t>(count));
    std::vector<ScreenVertex>& out = vertices_[n];
    if (out.capacity() > positions.size() / 3 * 4 + 1) out = {};  // kept for what needs about as much
    if (out.capacity() < positions.size()) {
      out = {};
      out.reserve(positions.size());
      preferHugePages(out.data(), out.capacity() * sizeof(ScreenVertex));
    }
    out.resize(positions.size());
    projectAll(originOf(n), positions, out);
    if (!isCurve(n)) continue;
    looks_.push_back(makeLook(curvesOf(n)));
    capsule_begins_.push_back(capsuleBegins(n));
  }
}

const glm::dvec3& SceneTriangles::originOf(size_t surface) const {
  return isCurve(surface) ? curvesOf(surface).set->origin : scene_.surfaces[surface].mesh->origin;
}

const std::vector<glm::vec3>& SceneTriangles::positionsOf(size_t surface) const {
  return isCurve(surface) ? curvesOf(surface).set->positions : scene_.surfaces[surface].mesh->positions;
}

bool SceneTriangles::isOpaque(size_t surface) const {
  return isCurve(surface) ? curvesOf(surface).opacity >= 1 : scene_.surfaces[surface].opacity.opaque();
}

/// Affine in the positions, and the perspective divide.
void SceneTriangles::projectAll(const glm::dvec3& origin, const std::vector<glm::vec3>& positions,
                                std::vector<ScreenVertex>& out) const {
  const bool perspective = view_.projection == Projection::kPerspective;
  const glm::dvec3 first = view_.viewFromData(origin);
  const glm::dvec3 right = view_.right * view_.scale, down = view_.down * view_.scale,
                   forward = view_.forward * view_.scale;
  tbb::parallel_for(tbb::blocked_range<size_t>(0, out.size(), kVerticesAtOnce), [&](const auto& range) {
    const auto inView = [&](size_t n) {
      const double x = positions[n].x, y = positions[n].y, z = positions[n].z;
      return glm::dvec3(first.x + (right.x * x + right.y * y + right.z * z),
                        first.y + (down.x * x + down.y * y + down.z * z),
                        first.z + (forward.x * x + forward.y * y + forward.z * z));
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
  return view_.viewFromData(originOf(surface) + glm::dvec3(positionsOf(surface)[vertex]));
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

/// The pieces of a batch, one triangle or capsule after the other.
class TriangleBins::Pieces {
 public:
  explicit Pieces(const TriangleBins& bins) : bins_(bins) {}

  /// Adds the one of a number, unless its box lies outside of the picture.
  void add(uint32_t number, float x0, float y0, float x1, float y1) {
    if (x0 >= left_ && x1 < right_ && y0 >= top_ && y1 < bottom_ && end_ == number) {
      ++pieces_.back().run.count;
      ++end_;
      return;
    }
    const TileBox box = bins_.tilesOf(x0, y0, x1, y1);
    if (box.empty()) return;
    if (end_ == number && !pieces_.empty() && pieces_.back().box == box) {
      ++pieces_.back().run.count;
    } else {
      pieces_.push_back({box, {number, 1}});
      const bool one = box.x0 == box.x1 && box.y0 == box.y1;
      left_ = static_cast<float>(box.x0 * kSampleTileWidth);
      top_ = static_cast<float>(box.y0 * kSampleTileHeight);
      right_ = one ? static_cast<float>(std::min((box.x0 + 1) * kSampleTileWidth, bins_.size_.width)) : left_;
      bottom_ = static_cast<float>(std::min((box.y0 + 1) * kSampleTileHeight, bins_.size_.height));
    }
    end_ = number + 1;
  }
  /// Adds to the last piece what is not drawn, so that the piece goes on after it.
  void skip(uint32_t number) {
    if (end_ != number || pieces_.empty()) return;
    ++pieces_.back().run.count;
    ++end_;
  }
  const std::vector<Piece>& all() const { return pieces_; }

 private:
  const TriangleBins& bins_;
  std::vector<Piece> pieces_;
  // The last piece's tile in pixels, where it is one tile: most triangles lie in their predecessor's.
  float left_ = 0, top_ = 0, right_ = 0, bottom_ = 0;
  uint32_t end_ = 0;  // of the last piece
};

TriangleBins::TriangleBins(const SceneTriangles& triangles)
    : columns_((triangles.view().size.width + kSampleTileWidth - 1) / kSampleTileWidth),
      rows_((triangles.view().size.height + kSampleTileHeight - 1) / kSampleTileHeight),
      size_(triangles.view().size) {
  for (size_t surface = 0; surface < triangles.sheets(); ++surface) {
    const uint32_t count = triangles.firstOf(surface + 1) - triangles.firstOf(surface);
    for (uint32_t first = 0; first < count; first += kTrianglesAtOnce) {
      Batch& batch = batches_.emplace_back();
      batch.surface = surface;
      batch.first = first;
      batch.count = std::min(kTrianglesAtOnce, count - first);
    }
  }
  tbb::parallel_for(size_t{0}, batches_.size(), [&](size_t n) { sort(triangles, batches_[n]); });
}

/// Vertices on the grid of samples lie up to 1/32 pixel away, and samples 1/16 inside of their pixels.
TriangleBins::TileBox TriangleBins::tilesOf(float x0, float y0, float x1, float y1) const {
  const auto width = static_cast<float>(size_.width), height = static_cast<float>(size_.height);
  // NaN and infinity are nowhere.
  if (!(x0 < width && x1 >= 0 && y0 < height && y1 >= 0 && x0 > -INFINITY && x1 < INFINITY &&
        y0 > -INFINITY && y1 < INFINITY))
    return {};
  const auto tile = [](float at, float most, int side) {
    return static_cast<int16_t>(static_cast<unsigned>(std::clamp(at, 0.0f, most - 1)) /
                                static_cast<unsigned>(side));
  };
  return {tile(x0, width, kSampleTileWidth), tile(y0, height, kSampleTileHeight),
          tile(x1, width, kSampleTileWidth), tile(y1, height, kSampleTileHeight)};
}

void TriangleBins::addTriangles(const SceneTriangles& triangles, const Batch& batch, Pieces& pieces) const {
  const TriangleMesh& mesh = *triangles.scene().surfaces[batch.surface].mesh;
  const std::vector<ScreenVertex>& vertices = triangles.verticesOf(batch.surface);
  const auto add = [&](uint32_t n, const ScreenVertex* at, size_t count) {
    float x0 = at[0].x, x1 = x0, y0 = at[0].y, y1 = y0;
    for (size_t v = 1; v < count; ++v) {
      x0 = std::min(x0, at[v].x);
      x1 = std::max(x1, at[v].x);
      y0 = std::min(y0, at[v].y);
      y1 = std::max(y1, at[v].y);
    }
    pieces.add(n, x0, y0, x1, y1);
  };
  for (uint32_t n = batch.first; n < batch.first + batch.count; ++n) {
    const auto& corners = mesh.triangles[n];
    const ScreenVertex at[3] = {vertices[corners[0]], vertices[corners[1]], vertices[corners[2]]};
    if (!std::isnan(at[0].value + at[1].value + at[2].value)) {
      add(n, at, 3);
      continue;
    }
    const NearPolygon polygon = triangles.behindNear(batch.surface, corners);
    if (polygon.count >= 3) add(n, polygon.vertices.data(), polygon.count);
  }
}

void TriangleBins::addCapsules(const SceneTriangles& triangles, const Batch& batch, Pieces& pieces) const {
  const CapsuleLook look = triangles.lookOf(batch.surface);
  for (uint32_t n = batch.first; n < batch.first + batch.count; ++n) {
    if (triangles.beginOf(batch.surface, n) == SceneTriangles::kNoCapsule) {
      pieces.skip(n);
      continue;
    }
    const CapsuleBox box = boxOf(triangles.capsuleOf(batch.surface, n), look);
    pieces.add(n, box.x0, box.y0, box.x1, box.y1);
  }
}

void TriangleBins::sort(const SceneTriangles& triangles, Batch& batch) const {
  Pieces of_batch(*this);
  triangles.isCurve(batch.surface) ? addCapsules(triangles, batch, of_batch)
                                   : addTriangles(triangles, batch, of_batch);
  const std::vector<Piece>& pieces = of_batch.all();
  if (pieces.empty()) return;
  TileBox all = pieces.front().box;
  for (const Piece& piece : pieces) {
    all.x0 = std::min(all.x0, piece.box.x0);
    all.y0 = std::min(all.y0, piece.box.y0);
    all.x1 = std::max(all.x1, piece.box.x1);
    all.y1 = std::max(all.y1, piece.box.y1);
  }
  batch.box = all;
  const auto width = static_cast<size_t>(all.x1 - all.x0 + 1);
  const auto forEach = [&](const auto& visit) {
    for (const Piece& piece : pieces)
      for (int y = piece.box.y0; y <= piece.box.y1; ++y)
        for (int x = piece.box.x0; x <= piece.box.x1; ++x)
          visit(static_cast<size_t>(y - all.y0) * width + static_cast<size_t>(x - all.x0), piece.run);
  };
  batch.begins.assign(width * static_cast<size_t>(all.y1 - all.y0 + 1) + 2, 0);
  forEach([&](size_t tile, const TriangleRun&) { ++batch.begins[tile + 2]; });
  for (size_t n = 2; n < batch.begins.size(); ++n) batch.begins[n] += batch.begins[n - 1];
  batch.runs.resize(batch.begins.back());
  forEach([&](size_t tile, const TriangleRun& run) { batch.runs[batch.begins[tile + 1]++] = run; });
  batch.begins.pop_back();
}

}  // namespace curvisplat
