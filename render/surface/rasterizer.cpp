#include "render/surface/rasterizer.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

namespace curvisplat {
namespace {

constexpr int kGrid = 16;   // to a pixel
constexpr int kSmall = 64;  // pixels: products of a small triangle's differences have fewer bits than a float
// Pixels: triangles that reach beyond are clipped there, so that double is exact.
constexpr float kGuard = 1e5f;
constexpr uint32_t kTrianglesAtOnce = 4096;

/// Bits that increase with the value.
uint32_t ordered(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

float disordered(uint32_t bits) {
  return std::bit_cast<float>(bits & 0x80000000u ? bits & 0x7fffffffu : ~bits);
}

/// To even where it lies between two. (Without SSE4 the library's function is a call.)
int nearestWhole(float value) {
  constexpr double kMagic = 6755399441055744.0;  // 1.5 * 2^52
  return static_cast<int>((static_cast<double>(value) + kMagic) - kMagic);
}

void lower(uint64_t& sample, uint64_t to) {
  const std::atomic_ref<uint64_t> at(sample);
  uint64_t now = at.load(std::memory_order_relaxed);
  while (to < now && !at.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
  }
}

}  // namespace

SceneTriangles::SceneTriangles(const SurfaceScene& scene, const ScreenView& view, double depth_origin)
    : scene_(scene), view_(view), depth_origin_(depth_origin), begins_{0} {
  for (const Surface& surface : scene.surfaces) {
    const TriangleMesh& mesh = *surface.mesh;
    begins_.push_back(begins_.back() + static_cast<uint32_t>(mesh.triangles.size()));
    std::vector<ScreenVertex>& out = vertices_.emplace_back(mesh.positions.size());
    const size_t number = vertices_.size() - 1;
    const PixelBox box = tbb::parallel_reduce(
        tbb::blocked_range<size_t>(0, out.size(), kTrianglesAtOnce), PixelBox(),
        [&](const auto& range, PixelBox of_range) {
          for (size_t n = range.begin(); n < range.end(); ++n) {
            out[n] = project(inView(number, static_cast<uint32_t>(n)));
            of_range.add(out[n], view_.size);
          }
          return of_range;
        },
        [](PixelBox a, const PixelBox& b) {
          a.add(b);
          return a;
        });
    box_.add(box);
  }
}

void SceneTriangles::PixelBox::add(const ScreenVertex& vertex, ImageSize size) {
  if (std::isnan(vertex.value)) {  // before the near plane: it may be anywhere
    add(PixelBox{0, 0, size.width, size.height});
    return;
  }
  const auto pixel = [](float at, int end) {
    return static_cast<int>(std::clamp(at, 0.0f, static_cast<float>(end)));
  };
  add(PixelBox{pixel(vertex.x - 1, size.width), pixel(vertex.y - 1, size.height),
               pixel(vertex.x + 2, size.width), pixel(vertex.y + 2, size.height)});
}

void SceneTriangles::PixelBox::add(const PixelBox& other) {
  x0 = std::min(x0, other.x0);
  y0 = std::min(y0, other.y0);
  x1 = std::max(x1, other.x1);
  y1 = std::max(y1, other.y1);
}

glm::dvec3 SceneTriangles::inView(size_t surface, uint32_t vertex) const {
  const TriangleMesh& mesh = *scene_.surfaces[surface].mesh;
  return view_.viewFromData(mesh.origin + glm::dvec3(mesh.positions[vertex]));
}

ScreenVertex SceneTriangles::project(const glm::dvec3& in_view) const {
  if (view_.projection == Projection::kPerspective && !(in_view.z >= view_.near)) return {0, 0, NAN};
  const glm::dvec2 pixel = view_.pixelFromView(in_view);
  const double value =
      view_.projection == Projection::kPerspective ? -1 / in_view.z : in_view.z - depth_origin_;
  return {static_cast<float>(pixel.x), static_cast<float>(pixel.y), static_cast<float>(value)};
}

float SceneTriangles::depthOf(float value, float x, float y) const {
  if (view_.projection != Projection::kPerspective) return value;
  const double across = (static_cast<double>(x) - 0.5 * view_.size.width) / view_.focal_px;
  const double down = (static_cast<double>(y) - 0.5 * view_.size.height) / view_.focal_px;
  return static_cast<float>(-1 / static_cast<double>(value) * std::sqrt(1 + across * across + down * down));
}

SceneTriangles::Place SceneTriangles::placeOf(uint32_t number) const {
  const auto after = std::upper_bound(begins_.begin(), begins_.end(), number);
  const auto surface = static_cast<size_t>(after - begins_.begin()) - 1;
  return {surface, number - begins_[surface]};
}

int SampleBand::rowsOf(ImageSize size, uint64_t bytes) {
  const uint64_t a_row = sizeof(uint64_t) * kSamples * static_cast<uint64_t>(size.width);
  return static_cast<int>(std::clamp<uint64_t>(bytes / a_row, 1, static_cast<uint64_t>(size.height)));
}

float SampleBand::valueOf(uint64_t sample) {
  return disordered(static_cast<uint32_t>(sample >> 32));
}

void SampleBand::draw(const SceneTriangles& triangles, int first_row, int rows) {
  first_row_ = first_row;
  rows_ = rows;
  tbb::parallel_for(tbb::blocked_range<size_t>(0, samples_.size(), 1 << 16), [&](const auto& range) {
    std::fill(samples_.begin() + static_cast<std::ptrdiff_t>(range.begin()),
              samples_.begin() + static_cast<std::ptrdiff_t>(range.end()), kNothing);
  });
  for (size_t surface = 0; surface < triangles.scene().surfaces.size(); ++surface) {
    const TriangleMesh& mesh = *triangles.scene().surfaces[surface].mesh;
    const auto count = static_cast<uint32_t>(mesh.triangles.size());
    tbb::parallel_for(tbb::blocked_range<uint32_t>(0, count, kTrianglesAtOnce), [&](const auto& range) {
      for (uint32_t n = range.begin(); n < range.end(); ++n) {
        const auto& corners = mesh.triangles[n];
        const std::array<ScreenVertex, 3> at{triangles.vertex(surface, corners[0]),
                                             triangles.vertex(surface, corners[1]),
                                             triangles.vertex(surface, corners[2])};
        const uint32_t number = triangles.firstOf(surface) + n;
        const float sum = at[0].value + at[1].value + at[2].value;
        if (std::isnan(sum))
          drawNear(triangles, surface, corners, number);
        else
          drawTriangle(at, number);
      }
    });
  }
}

/// What of a triangle lies behind the near plane, as one or two triangles.
void SampleBand::drawNear(const SceneTriangles& triangles, size_t surface,
                          const std::array<uint32_t, 3>& corners, uint32_t number) {
  const double near = triangles.view().near;
  std::array<glm::dvec3, 3> in_view;
  for (size_t n = 0; n < 3; ++n) in_view[n] = triangles.inView(surface, corners[n]);
  std::array<ScreenVertex, 4> polygon;
  size_t count = 0;
  for (size_t n = 0; n < 3; ++n) {
    const glm::dvec3 &a = in_view[n], &b = in_view[(n + 1) % 3];
    if (a.z >= near) polygon[count++] = triangles.project(a);
    if ((a.z >= near) == (b.z >= near)) continue;
    glm::dvec3 cut = a + (near - a.z) / (b.z - a.z) * (b - a);
    cut.z = near;
    polygon[count++] = triangles.project(cut);
  }
  for (size_t n = 2; n < count; ++n) drawTriangle({polygon[0], polygon[n - 1], polygon[n]}, number);
}

/// Coordinates in 1/16 pixel from `x`, `y` (pixels): exact in float for small triangles.
struct SampleBand::Setup {
  std::array<double, 3> x, y;  // turning so that the inside is positive
  int x0, y0, x1, y1;          // pixels, the last included
  double value, by_x, by_y;    // at the centre of pixel (x0, y0), and a pixel
};

/// The part of a polygon where sign * (x or y) <= kGuard.
static void clipToGuard(std::vector<ScreenVertex>& polygon, float ScreenVertex::*axis, float sign) {
  std::vector<ScreenVertex> kept;
  for (size_t n = 0; n < polygon.size(); ++n) {
    const ScreenVertex &a = polygon[n], &b = polygon[(n + 1) % polygon.size()];
    const bool a_in = sign * a.*axis <= kGuard, b_in = sign * b.*axis <= kGuard;
    if (a_in) kept.push_back(a);
    if (a_in == b_in) continue;
    const float part = (sign * kGuard - a.*axis) / (b.*axis - a.*axis);
    ScreenVertex cut{std::lerp(a.x, b.x, part), std::lerp(a.y, b.y, part), std::lerp(a.value, b.value, part)};
    cut.*axis = sign * kGuard;
    kept.push_back(cut);
  }
  polygon = std::move(kept);
}

void SampleBand::drawTriangle(const std::array<ScreenVertex, 3>& corners, uint32_t number) {
  float farthest = 0;
  for (const ScreenVertex& corner : corners)
    farthest = std::max({farthest, std::abs(corner.x), std::abs(corner.y)});
  if (!(farthest < INFINITY)) return;
  if (farthest <= kGuard) return drawGuarded(corners, number);
  std::vector<ScreenVertex> polygon(corners.begin(), corners.end());
  for (const auto axis : {&ScreenVertex::x, &ScreenVertex::y})
    for (const float sign : {-1.0f, 1.0f}) clipToGuard(polygon, axis, sign);
  for (size_t n = 2; n < polygon.size(); ++n) drawGuarded({polygon[0], polygon[n - 1], polygon[n]}, number);
}

void SampleBand::drawGuarded(const std::array<ScreenVertex, 3>& corners, uint32_t number) {
  Setup setup;
  std::array<int, 3> grid_x, grid_y;
  for (size_t n = 0; n < 3; ++n) {
    grid_x[n] = nearestWhole(corners[n].x * float{kGrid});
    grid_y[n] = nearestWhole(corners[n].y * float{kGrid});
  }
  // The outermost samples are 7/16 from the centre.
  const int least_x = std::min({grid_x[0], grid_x[1], grid_x[2]});
  const int most_x = std::max({grid_x[0], grid_x[1], grid_x[2]});
  const int least_y = std::min({grid_y[0], grid_y[1], grid_y[2]});
  const int most_y = std::max({grid_y[0], grid_y[1], grid_y[2]});
  constexpr int kGridBits = 4;
  static_assert(1 << kGridBits == kGrid);
  setup.x0 = std::max(0, (least_x - 1) >> kGridBits);
  setup.x1 = std::min(width_ - 1, most_x >> kGridBits);
  setup.y0 = std::max(first_row_, (least_y - 1) >> kGridBits);
  setup.y1 = std::min(first_row_ + rows_ - 1, most_y >> kGridBits);
  if (setup.x0 > setup.x1 || setup.y0 > setup.y1) return;
  for (size_t n = 0; n < 3; ++n) {
    setup.x[n] = grid_x[n];
    setup.y[n] = grid_y[n];
  }

  const double area = (setup.x[1] - setup.x[0]) * (setup.y[2] - setup.y[0]) -
                      (setup.y[1] - setup.y[0]) * (setup.x[2] - setup.x[0]);
  if (area == 0) return;
  // The value's plane is the exact triangle's, where that has an area.
  const double dx1 = static_cast<double>(corners[1].x) - static_cast<double>(corners[0].x);
  const double dy1 = static_cast<double>(corners[1].y) - static_cast<double>(corners[0].y);
  const double dx2 = static_cast<double>(corners[2].x) - static_cast<double>(corners[0].x);
  const double dy2 = static_cast<double>(corners[2].y) - static_cast<double>(corners[0].y);
  const double exact_area = dx1 * dy2 - dy1 * dx2;
  const double dv1 = static_cast<double>(corners[1].value) - static_cast<double>(corners[0].value);
  const double dv2 = static_cast<double>(corners[2].value) - static_cast<double>(corners[0].value);
  const double per_area = exact_area != 0 ? 1 / exact_area : 0;
  setup.by_x = (dv1 * dy2 - dv2 * dy1) * per_area;
  setup.by_y = (dv2 * dx1 - dv1 * dx2) * per_area;
  setup.value = static_cast<double>(corners[0].value) +
                setup.by_x * (setup.x0 + 0.5 - static_cast<double>(corners[0].x)) +
                setup.by_y * (setup.y0 + 0.5 - static_cast<double>(corners[0].y));
  if (area < 0) {
    std::swap(setup.x[1], setup.x[2]);
    std::swap(setup.y[1], setup.y[2]);
  }
  if (most_x - least_x <= kSmall * kGrid && most_y - least_y <= kSmall * kGrid)
    fill<float>(setup, number);
  else
    fill<double>(setup, number);
}

/// Edge functions: positive on the inner side, and on the edge itself for top and left edges.
template <typename Real>
void SampleBand::fill(const Setup& setup, uint32_t number) {
  Real by_x[3], by_y[3], row_start[3], most[3];
  Real offsets[3][kSamples];
  for (size_t edge = 0; edge < 3; ++edge) {
    const size_t a = edge, b = (edge + 1) % 3;
    by_x[edge] = static_cast<Real>(-(setup.y[b] - setup.y[a]));
    by_y[edge] = static_cast<Real>(setup.x[b] - setup.x[a]);
    const bool takes_edge = by_x[edge] > 0 || (by_x[edge] == 0 && by_y[edge] > 0);
    const auto from_x = static_cast<Real>(kGrid * setup.x0 + kGrid / 2 - setup.x[a]);
    const auto from_y = static_cast<Real>(kGrid * setup.y0 + kGrid / 2 - setup.y[a]);
    row_start[edge] = by_x[edge] * from_x + by_y[edge] * from_y + (takes_edge ? Real{0} : Real{-0.5f});
    for (size_t s = 0; s < kSamples; ++s)
      offsets[edge][s] = by_x[edge] * static_cast<Real>(kSampleOffsets[s][0]) +
                         by_y[edge] * static_cast<Real>(kSampleOffsets[s][1]);
    // No sample's offset is more.
    most[edge] = static_cast<Real>(kGrid / 2 - 1) * (std::abs(by_x[edge]) + std::abs(by_y[edge]));
    by_x[edge] *= kGrid;
    by_y[edge] *= kGrid;
  }
  const auto value_x = static_cast<float>(setup.by_x / kGrid),
             value_y = static_cast<float>(setup.by_y / kGrid);
  for (int y = setup.y0; y <= setup.y1; ++y) {
    uint64_t* row = &samples_[kSamples * (static_cast<size_t>(y - first_row_) * static_cast<size_t>(width_) +
                                          static_cast<size_t>(setup.x0))];
    Real at[3] = {row_start[0], row_start[1], row_start[2]};
    for (int x = setup.x0; x <= setup.x1; ++x, row += kSamples) {
      if (at[0] + most[0] >= 0 && at[1] + most[1] >= 0 && at[2] + most[2] >= 0) {
        unsigned inside = 0;
        for (size_t s = 0; s < kSamples; ++s)
          inside |= static_cast<unsigned>(at[0] + offsets[0][s] >= 0 && at[1] + offsets[1][s] >= 0 &&
                                          at[2] + offsets[2][s] >= 0)
                    << s;
        const auto value =
            static_cast<float>(setup.value + setup.by_x * (x - setup.x0) + setup.by_y * (y - setup.y0));
        for (; inside != 0; inside &= inside - 1) {
          const auto s = static_cast<size_t>(std::countr_zero(inside));
          const float of_sample = value_x * static_cast<float>(kSampleOffsets[s][0]) +
                                  value_y * static_cast<float>(kSampleOffsets[s][1]);
          lower(row[s], uint64_t{ordered(value + of_sample)} << 32 | number);
        }
      }
      for (size_t edge = 0; edge < 3; ++edge) at[edge] += by_x[edge];
    }
    for (size_t edge = 0; edge < 3; ++edge) row_start[edge] += by_y[edge];
  }
}

}  // namespace curvisplat
